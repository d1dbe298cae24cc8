"""The rectangle of the world that a drawing shows, and where its places are on the page."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

# Nothing farther outside can be seen, and some viewers fail on large numbers, pixels.
FAR = 1e5


@dataclass(frozen=True, slots=True)
class Frame:
    """`low` and `high` are corners of the world in m, `scale` is in pixels for one m; `left` and `top` are on the page, pixels."""

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
        """Whether a place is on the map."""
        return point is not None and bool((self.low <= point).all() and (point <= self.high).all())

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """(N, 2) m to (N, 2) pixels, y downwards."""
        away = (points - (self.low[0], self.high[1])) * (self.scale, -self.scale)
        return np.clip(away, -FAR, FAR) + np.array([self.left, self.top])


def tick_step(span: float, most: int) -> float:
    """The least of 1, 2, 5, 10, 20 ... (and 0.5, 0.2, 0.1 ...) m of which at most `most` fit into `span` m."""
    least = span / max(1, most)
    if not (math.isfinite(least) and least > 0):
        return 1.0
    power = 10.0 ** math.floor(math.log10(least))
    return next(power * factor for factor in (1, 2, 5, 10, 20) if power * factor >= least * (1 - 1e-9))


def ticks(low: float, high: float, step: float) -> list[float]:
    """The multiples of `step` from `low` to `high`, m."""
    first, last = math.ceil(low / step - 1e-9), math.floor(high / step + 1e-9)
    # Adding zero makes -0.0 the same as 0.0.
    return [number * step + 0.0 for number in range(first, last + 1)]


def tick_text(value: float, step: float) -> str:
    """`value` with as many decimals as `step` needs."""
    decimals = max(0, -math.floor(math.log10(step) + 1e-9))
    return f"{value:.{decimals}f}"
