"""The part of the world that a drawing shows, its scale on the page, and the ticks of its axes."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

# Maximum distance outside the page, pixels: some viewers fail on large numbers.
FAR = 1e5


@dataclass(frozen=True, slots=True)
class Frame:
    """The rectangle from `low` to `high`, m, drawn with `scale` pixels per m at `left` and `top` on the page, pixels."""

    low: np.ndarray
    high: np.ndarray
    scale: float
    left: float
    top: float

    @property
    def box(self) -> np.ndarray:
        """Left, top, right and bottom, pixels."""
        width, height = (self.high - self.low) * self.scale
        return np.array([self.left, self.top, self.left + width, self.top + height])

    def holds(self, point: tuple[float, float] | None) -> bool:
        """Whether the point (m) is on the map."""
        return point is not None and bool((self.low <= point).all() and (point <= self.high).all())

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Points (N, 2) m to (N, 2) pixels, y downwards."""
        away = (points - (self.low[0], self.high[1])) * (self.scale, -self.scale)
        pixels: np.ndarray = np.clip(away, -FAR, FAR) + np.array([self.left, self.top])
        return pixels


def tick_step(span: float, most: int) -> float:
    """The smallest of 1, 2, 5, 10, 20 ... (and 0.5, 0.2, 0.1 ...) m of which `most` or fewer fit into `span` m."""
    least = span / max(1, most)
    if not (math.isfinite(least) and least > 0):
        return 1.0
    power = 10.0 ** math.floor(math.log10(least))
    return next(power * factor for factor in (1, 2, 5, 10, 20) if power * factor >= least * (1 - 1e-9))


def ticks(low: float, high: float, step: float) -> list[float]:
    """The multiples of `step` from `low` to `high`, m."""
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    # Adding zero turns -0.0 into 0.0.
    return [number * step + 0.0 for number in range(first, last + 1)]


def tick_text(value: float, step: float) -> str:
    """`value` with as many decimals as `step` needs."""
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    return f"{value:.{decimals}f}"
