"""The lidar of one run: it computes a scan's ranges only when someone needs them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache, partial
from itertools import accumulate
from typing import Any

import numpy as np

from ddenv.arrays import Booleans, Floats, Integers
from ddenv.robot.protocol import Scan
from ddenv.robot.result import PoseRow
from ddenv.robot.sensing.beams import SPARE, Fan, Obstacles, Shapes, cast
from ddenv.world import scenario
from ddenv.world.model import Model
from ddenv.world.pose import Pose, Vector

DRAWS = 2**40  # random numbers reserved for the noise of each scan
# Of a scan: its ranges, what its beams measured, also too near or too far, (B,) m each; the beams
# (H,) that ended on models (H,).
Measured = tuple[Floats, Floats, Integers, Integers]


class Lidar:
    """Measures the distances to the kept models of a world, never to the robot itself.

    `present` are the names of the kept models, `moving` the ones among them that move. `first_seen`
    has the time (s) when a beam first ended on each model, including grounds.
    """

    def __init__(
        self,
        settings: scenario.Lidar,
        obstacles: Obstacles,
        present: frozenset[str],
        moving: Sequence[Model],
        random: np.random.Generator,
    ) -> None:
        self._settings = settings
        self._mount = Pose((settings.x, settings.y, settings.z))
        self._random = random
        self._state = random.bit_generator.state
        self._turns = 0
        self._fan = Fan.of(settings)
        self._names = obstacles.names
        self.first_seen: dict[str, float] = {}
        self._unseen: Booleans = np.ones(len(obstacles.names), dtype=bool)
        # When a scan was made in which a beam ended on each model, of those that someone read, s.
        self._read: Floats = np.full(len(obstacles.names), np.inf)

        there = np.array([name in present for name in obstacles.names], dtype=bool)
        (rows,) = there[obstacles.owners].nonzero()
        self._owners = obstacles.owners[rows]
        self._shapes = obstacles.shapes.take(rows)
        (self._movers,) = (obstacles.links[rows] >= 0).nonzero()
        firsts = accumulate((len(model.links) for model in moving), initial=0)
        first = {model.name: first for model, first in zip(moving, firsts, strict=False)}
        owners = [obstacles.names[owner] for owner in self._owners[self._movers]]
        self._links = obstacles.links[rows][self._movers] + np.array(
            [first[name] for name in owners], dtype=int
        )
        # In the frames of their links, which do not change during the run.
        self._centers = self._shapes.centers[:, self._movers]
        self._frames = self._shapes.frames[:, :, self._movers]

    @property
    def took_part(self) -> dict[str, float]:
        """The models without which a scan that was read would be another, each with the time (s) of
        the first one.
        """
        return {
            name: at
            for name, at in zip(self._names, self._read.tolist(), strict=True)
            if at < np.inf
        }

    def scan(self, now: float, pose: PoseRow, places: Floats, turns: Floats) -> Scan:
        """The scan at the time `now` (s).

        `pose` is the pose of the robot's first link; `places` (L, 3) m and `turns` (L, 3, 3) are
        the poses of all links of the moving models, model after model. All are in the world frame.
        """
        place = Pose(pose[:3], pose[3:]) @ self._mount
        self._move(places, turns)
        rows = in_the_way(self._fan, self._shapes, np.array(place.position), place.rotation().T)
        models = self._owners[rows]
        measure = cache(partial(self._measure, self._turns, place, self._shapes.take(rows), models))
        self._turns += 1
        if self._unseen[models].any():
            ranges, _, beams, owners = measure()
            met = np.isfinite(ranges[beams]) & self._unseen[owners]
            # In the order of the beams, and for one beam in that of the models.
            for _, owner in sorted(zip(beams[met].tolist(), owners[met].tolist(), strict=True)):
                self._unseen[owner] = False
                self.first_seen.setdefault(self._names[owner], now)
        return LazyScan(
            now, self._fan.angles, partial(self._ranges, now, measure), self._mount.position
        )

    def _ranges(
        self, now: float, measure: Callable[[], Measured], limits: Floats | None = None
    ) -> Floats:
        """The ranges of the scan at `now` (s), infinite where they exceed `limits` (B,) m."""
        ranges, measured, beams, owners = measure()
        if limits is not None:
            # Behind a hit that is too far the next one is farther, with the same noise: that would
            # not be seen either.
            near: Booleans = measured <= limits
            ranges = np.where(near, ranges, np.inf)
            owners = owners[near[beams]]
        self._read[owners] = np.minimum(self._read[owners], now)
        return ranges

    def _measure(self, number: int, place: Pose, shapes: Shapes, models: Integers) -> Measured:
        """Makes scan `number` from `place`; its beams may hit the `shapes` (K,) of these `models`
        (K,).
        """
        distances, beams, hit = cast(
            self._fan, shapes, np.array(place.position), place.rotation().T
        )
        # The errors of the ranges are the same whatever the beams hit, and whichever scans are
        # computed.
        bits: Any = self._random.bit_generator
        bits.state = self._state
        bits.advance(number * DRAWS)
        noise = self._settings.noise * self._random.standard_normal(len(self._fan.angles))
        measured = noise + distances
        beyond = (measured < self._settings.nearest) | (measured > self._settings.range)
        return np.where(beyond, np.inf, measured), measured, beams, models[hit]

    def _move(self, places: Floats, turns: Floats) -> None:
        if not len(self._movers):
            return
        turn = turns[self._links].transpose(1, 2, 0)
        first, second, third = (turn[:, axis] for axis in range(3))
        a, b, c = self._centers
        self._shapes.centers[:, self._movers] = (
            first * a + second * b + third * c + places[self._links].T
        )
        a, b, c = self._frames
        frames = first[:, None] * a + second[:, None] * b + third[:, None] * c
        self._shapes.frames[:, :, self._movers] = frames


class LazyScan(Scan):
    """A scan that computes its `ranges` only when they are read. `dataclasses.replace` makes copies
    whose ranges are an array.
    """

    __slots__ = ("_ranges",)
    _ranges: Callable[..., Floats] | Floats

    def __init__(
        self, time: float, angles: Floats, ranges: Callable[..., Floats] | Floats, origin: Vector
    ) -> None:
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "angles", angles)
        object.__setattr__(self, "_ranges", ranges)
        object.__setattr__(self, "origin", origin)

    @property
    def ranges(self) -> Floats:
        if callable(self._ranges):
            return self._ranges()
        return self._ranges

    def within(self, limits: Floats) -> Floats:
        if callable(self._ranges):
            return self._ranges(limits)
        return super().within(limits)

    def __reduce__(self) -> tuple[type[Scan], tuple[Any, ...]]:
        return Scan, (self.time, self.angles, self.ranges, self.origin)


def in_the_way(fan: Fan, shapes: Shapes, origin: Floats, axes: Floats) -> Integers:
    """The numbers (K,) of the shapes that the beams may hit from `origin` (3,).

    `axes` (3, 3) are the lidar's axes, as rows; the beams lie in the plane of the first two.
    """
    # A matrix product may round differently among more shapes: nothing else is computed from this
    # one.
    ahead, left, above = axes @ (shapes.centers - origin[:, None])
    far = shapes.reaches + fan.range
    numbers: Integers = (
        (np.abs(above) <= shapes.reaches) & (ahead * ahead + left * left <= far * far)
    ).nonzero()[0]
    frames = shapes.frames.take(numbers, axis=2)
    away = origin[:, None] - shapes.centers.take(numbers, axis=1)
    local = (away[:, None] * frames).sum(axis=0)
    up = (axes[2][:, None, None] * frames).sum(axis=0)
    # Half the edges of the boxes around the shapes, and their centers, along the lidar's vertical
    # axis.
    edges = up * shapes.squares.take(numbers, axis=1)
    cut = np.abs((edges * local).sum(axis=0)) <= np.abs(edges).sum(axis=0) + SPARE
    # How far the beams get along each of a shape's axes: a ground may be at the right height, but
    # beyond their range.
    extents = np.sqrt(np.maximum((frames * frames).sum(axis=0) - up * up, 0.0))
    met: Booleans = cut & (
        np.abs(local) - 1.0 <= extents * (fan.range * (1.0 + SPARE)) + SPARE
    ).all(axis=0)
    return numbers[met]
