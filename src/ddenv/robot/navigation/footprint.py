"""The ground that the robot covers, as a rectangle, and what would be in its way."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ddenv.robot.protocol import Setup

# Points nearer to the robot than this part of its padding count as touched.
TOUCHED = 0.6
# Turns a direction, with its parts the other way round, to the left.
LEFT = np.array([-1.0, 1.0])


@dataclass(frozen=True, slots=True)
class Footprint:
    """How far the robot reaches from its origin, m: `ahead`, `behind`, and to each `side`, which are taken as equal.

    What is nearer than `margin` (m) counts as touched.
    """

    ahead: float
    behind: float
    side: float
    margin: float = 0.0

    @classmethod
    def of(cls, setup: Setup) -> Footprint:
        """That of the robot of `setup`."""
        ahead, behind, left, right = setup.footprint
        return cls(ahead, behind, max(left, right), TOUCHED * setup.settings.planner.padding)

    @property
    def inscribed(self) -> float:
        """Radius (m) about the origin that the robot covers however it is turned."""
        return min(self.ahead, self.behind, self.side)

    @property
    def circumscribed(self) -> float:
        """Radius (m) about the origin beyond which the robot never reaches."""
        return float(np.hypot(max(self.ahead, self.behind), self.side))

    def apart(self, points: np.ndarray, places: np.ndarray) -> np.ndarray:
        """How far (K, N) m `points` (3, N), the third row 1, are from the footprint with its margin at least; inside below 0.

        `places` (2, K, 3) turn such a point into how far ahead and how far aside of the robot it is, for each of K places.
        """
        beyond = places.reshape(-1, 3) @ points
        count = places.shape[1]
        beyond[:count] -= (self.ahead - self.behind) / 2
        np.abs(beyond, out=beyond)
        beyond[:count] -= (self.ahead + self.behind) / 2 + self.margin
        beyond[count:] -= self.side + self.margin
        return np.maximum(beyond[:count], beyond[count:])


def legs_beside(
    points: np.ndarray,
    starts: np.ndarray,
    ends: np.ndarray,
    back: np.ndarray | float,
    on: np.ndarray | float,
    side: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Which straight legs are free of `points` (N, 2), N > 0, and how near (m) the nearest point is to each; both (K,).

    A leg from `starts` (K, 2) to `ends` (K, 2) is free if no point is within `side` of it, from `back` (K,) before its start to
    `on` (K,) after its end. All in m.
    """
    ways = ends - starts
    lengths = np.sqrt((ways * ways).sum(axis=1, keepdims=True))
    np.maximum(lengths, 1e-9, out=lengths)
    ways = ways / lengths
    across_them = ways[:, ::-1] * LEFT
    along = ways @ points.T
    along -= (ways * starts).sum(axis=1, keepdims=True)
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
    return ~hit.any(axis=1), np.sqrt(across.min(axis=1))
