"""A way to drive: straight legs between corners, and how far along it the robot is."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import accumulate, pairwise

import numpy as np

Place = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Leg:
    """From (x, y) along (cosine, sine) for `length` (m)."""

    x: float
    y: float
    cosine: float
    sine: float
    length: float


class Path:
    """Straight legs between `corners` (x, y; m), at least two.

    `final` tells whether it ends where the robot wants to be in the end. `back` and `on` (m) are how much free ground each leg
    was given before its start and after its end. `off` (m) is how far beside it the robot is.
    """

    def __init__(self, corners: list[Place], final: bool = True, back: float = 0.0, on: float = 0.0) -> None:
        self.corners = corners
        self.final = final
        self.back, self.on = back, on
        self.off = 0.0
        self._legs = [_leg(*pair) for pair in pairwise(corners)]
        # How long the rest is from the start of each leg.
        self._rests = list(accumulate(leg.length for leg in self._legs[::-1]))[::-1]
        self._number = 0
        self._along = 0.0

    @property
    def end(self) -> Place:
        return self.corners[-1]

    @property
    def left(self) -> float:
        """How long (m) the rest of it is."""
        return self._rests[self._number] - self._along

    def locate(self, x: float, y: float) -> None:
        """Note that the robot is at (x, y): it never goes back, and reaches the legs in turn."""
        self.off = math.inf
        for number in range(self._number, min(self._number + 2, len(self._legs))):
            leg = self._legs[number]
            dx, dy = x - leg.x, y - leg.y
            along = min(max(dx * leg.cosine + dy * leg.sine, 0.0), leg.length)
            off = math.hypot(dx - along * leg.cosine, dy - along * leg.sine)
            if off <= self.off:
                self.off, self._number, self._along = off, number, along

    def ahead(self, distance: float) -> Place:
        """The place `distance` (m) further along it, or its end."""
        number, along = self._number, self._along + distance
        while along > self._legs[number].length and number + 1 < len(self._legs):
            along -= self._legs[number].length
            number += 1
        leg = self._legs[number]
        along = min(along, leg.length)
        return leg.x + along * leg.cosine, leg.y + along * leg.sine

    def rest(self) -> np.ndarray:
        """The corners (K, 2) m that are left, beginning where the robot is along it."""
        return np.array([self.ahead(0.0), *self.corners[self._number + 1 :]])


def _leg(start: Place, end: Place) -> Leg:
    dx, dy = end[0] - start[0], end[1] - start[1]
    length = math.hypot(dx, dy)
    if not length:
        return Leg(*start, 1.0, 0.0, 0.0)
    return Leg(*start, dx / length, dy / length, length)
