"""The rectangle of the world that a drawing shows, and where its places are on the page."""

from __future__ import annotations

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
