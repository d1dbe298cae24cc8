"""The part of a world that is in the plant: what never moves is left out where nothing comes near
it.

Drake knows every pair of shapes: 5,000 crates take minutes to build and gigabytes to hold. What
nothing touches changes no bit of a run, so the plant has only what lies around the robot's way and
around models that can move. A run in which something comes near the region's edge is given up, and
made again from its start in a larger one: as if that had been the plant from the beginning.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ddenv.arrays import Booleans, Floats
from ddenv.world.extent import Bounds, model_bounds, stacked
from ddenv.world.model import Model
from ddenv.world.pose import Point

WIDTH = 8.0  # how far a region extends to each side of the straight way to the goal, m
AROUND = 4.0  # and around each model that can move, m: most of them fall or lie where they are
# Whatever is simulated keeps this distance from the edge at each tick, m: between two ticks nothing
# gets so far and back, unless it does 40 m/s.
MARGIN = 2.0
# A world with at most so many shapes that never move is in the plant as a whole: that costs less
# than to watch an edge.
FEW = 300


class LeftRegion(Exception):
    """Something that is simulated came near the edge of the region, at `place` (x, y, m)."""

    def __init__(self, place: Point) -> None:
        super().__init__(place)
        self.place = place


@dataclass(frozen=True)
class Region:
    """All places within `widths` (S,) m of straight lines from `starts` (S, 2) m to `ends` (S, 2)
    m, seen from above.
    """

    starts: Floats
    ends: Floats
    widths: Floats

    @classmethod
    def of(cls, spawn: Point, goal: Point, moving: Iterable[Model]) -> Region:
        """The region around the way from `spawn` to `goal` and around the models `moving`."""
        boxes = (box for model in moving if (box := model_bounds(model)) is not None)
        places = [
            (((low + high) / 2)[:2], AROUND + np.linalg.norm((high - low)[:2]) / 2)
            for low, high in boxes
        ]
        starts = np.array([spawn, *(place for place, _ in places)], dtype=float)
        ends = np.array([goal, *starts[1:]], dtype=float)
        return cls(starts, ends, np.array([WIDTH, *(width for _, width in places)]))

    def with_place(self, place: Point, times: int) -> Region:
        """A region that extends also around `place` (m), `times` as far as around the way."""
        starts = np.vstack([self.starts, place])
        ends = np.vstack([self.ends, place])
        return Region(starts, ends, np.append(self.widths, times * WIDTH))

    def reaches(self, place: Point, radius: float) -> bool:
        """Whether any place within `radius` (m) of `place` (m) is in the region."""
        return bool(self._depths(np.array([place]))[0] + radius >= 0)

    def far(self, models: Iterable[Model]) -> frozenset[str]:
        """The names of those among `models` that never move and lie outside; none if there are few
        shapes in all.
        """
        static = [model for model in models if model.static]
        if sum(len(model.collisions) for model in static) <= FEW:
            return frozenset()
        found = [(model.name, box) for model in static if (box := model_bounds(model)) is not None]
        low, high = stacked(box for _, box in found)
        outside = self._depths((low + high)[:, :2] / 2) + _radii(low, high) < 0
        return frozenset(name for (name, _), out in zip(found, outside, strict=True) if out)

    def watch(self, place: Point, reach: float, models: Bounds) -> None:
        """As `check` for the boxes `models`, and for the robot, no part of which is farther than
        `reach` (m) from `place`.
        """
        self.check(models)
        if not float(self._depths(np.array([place]))[0]) >= reach + MARGIN:
            raise LeftRegion(place)

    def check(self, boxes: Bounds) -> None:
        """Raises LeftRegion unless all boxes, between corners (N, 3) m and (N, 3) m, keep their
        distance from the edge.
        """
        low, high = boxes
        if not len(low):
            return
        places = (low + high)[:, :2] / 2
        # A box around nothing has its highest corner below its lowest.
        solid = (low <= high).all(axis=1)
        near: Booleans = solid & ~(self._depths(places) >= _radii(low, high) + MARGIN)
        if near.any():
            x, y = places[near.argmax()].tolist()
            raise LeftRegion((x, y))

    def _depths(self, places: Floats) -> Floats:
        """How far inside the edge each of `places` (N, 2) m is."""
        depths = np.full(len(places), -np.inf)
        for start, end, width in zip(self.starts, self.ends, self.widths, strict=True):
            way = end - start
            along = np.clip((places - start) @ way / max(float(way @ way), 1e-12), 0.0, 1.0)
            apart = np.linalg.norm(places - start - along[:, None] * way, axis=1)
            depths = np.maximum(depths, width - apart)
        return depths


def _radii(low: Floats, high: Floats) -> Floats:
    """The radii (N,) of circles around boxes, seen from above, m."""
    radii: Floats = np.linalg.norm((high - low)[:, :2], axis=1) / 2
    return radii
