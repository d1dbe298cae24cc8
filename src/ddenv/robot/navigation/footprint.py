"""The robot's footprint, and how near points come to it or to a straight path."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ddenv.arrays import Booleans, Floats
from ddenv.robot.protocol import Estimate, Setup

TOUCHED = 0.6  # points nearer to the robot than this part of its padding count as touched
LEFT = np.array(
    [-1.0, 1.0]
)  # turns a direction, with its components swapped, by 90 degrees to the left


@dataclass(frozen=True, slots=True)
class Footprint:
    """The robot's outline seen from above: how far it extends from its origin `ahead`, `behind` and
    to each `side`, m.

    Both sides are taken as equal. Points within `margin` (m) of the outline count as touched.
    """

    ahead: float
    behind: float
    side: float
    margin: float = 0.0

    @classmethod
    def of(cls, setup: Setup) -> Footprint:
        """The footprint of the robot of `setup`."""
        ahead, behind, left, right = setup.footprint
        return cls(ahead, behind, max(left, right), TOUCHED * setup.settings.planner.padding)

    @property
    def inscribed(self) -> float:
        """The radius (m) of the largest circle about the origin inside the footprint."""
        return min(self.ahead, self.behind, self.side)

    @property
    def circumscribed(self) -> float:
        """The radius (m) of the smallest circle about the origin around the footprint."""
        return float(np.hypot(max(self.ahead, self.behind), self.side))

    def apart(self, points: Floats, places: Floats) -> Floats:
        """A lower bound (K, N) of the distance of `points` from the footprint with its margin, m,
        at K poses; negative inside.

        `points` (3, N) are x, y (m) and 1. `places` (2, K, 3) are matrices that turn such a point
        into its distance ahead of the robot and to its left, for each pose.
        """
        beyond = places.reshape(-1, 3) @ points
        count = places.shape[1]
        beyond[:count] -= (self.ahead - self.behind) / 2
        np.abs(beyond, out=beyond)
        beyond[:count] -= (self.ahead + self.behind) / 2 + self.margin
        beyond[count:] -= self.side + self.margin
        return np.maximum(beyond[:count], beyond[count:])


def seen_from(estimate: Estimate) -> Floats:
    """The matrix (3, 3) from the estimates' frame to the robot's frame, for points x, y (m) and
    1.
    """
    x = estimate.x
    y = estimate.y
    cosine = math.cos(estimate.heading)
    sine = math.sin(estimate.heading)
    return np.array(
        [
            [cosine, sine, -cosine * x - sine * y],
            [-sine, cosine, sine * x - cosine * y],
            [0.0, 0.0, 1.0],
        ]
    )


def legs_beside(
    points: Floats,
    starts: Floats,
    ends: Floats,
    back: Floats | float,
    on: Floats | float,
    side: float,
) -> tuple[Booleans, Floats]:
    """Which of K straight legs are free of `points`, and the distance (m) of the nearest point to
    each leg; both (K,).

    `points` (N, 2), N > 0, `starts` and `ends` (K, 2) of the legs are in m. A leg is free if no
    point is within `side` of its line, from `back` before its start to `on` after its end (m; one
    for all, or (K,)).
    """
    directions = ends - starts
    lengths = np.sqrt((directions * directions).sum(axis=1, keepdims=True))
    np.maximum(lengths, 1e-9, out=lengths)
    directions = directions / lengths
    across_them = directions[:, ::-1] * LEFT
    along = directions @ points.T
    along -= (directions * starts).sum(axis=1, keepdims=True)
    across = across_them @ points.T
    across -= (across_them * starts).sum(axis=1, keepdims=True)
    np.abs(across, out=across)
    after = along - lengths
    hit = along > -np.asarray(back)[..., None]
    hit &= across < side
    hit &= after < np.asarray(on)[..., None]
    beyond = np.maximum(np.negative(along, out=along), after, out=along)
    np.maximum(beyond, 0.0, out=beyond)
    beyond *= beyond
    across *= across
    across += beyond
    free: Booleans = ~hit.any(axis=1)
    return free, np.sqrt(across.min(axis=1))
