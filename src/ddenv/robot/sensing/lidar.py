"""The lidar of one run."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

import numpy as np

from ddenv.robot.sensing.beams import Ends, Fan, Shapes, cast, in_the_way
from ddenv.robot.sensing.obstacles import Obstacles
from ddenv.robot.sensing.readings import Scan
from ddenv.world import scenario
from ddenv.world.model import Model
from ddenv.world.pose import Pose, Vector

# How far from where they were looked for (m), how much of it upwards (m), and how much tilted (rad) the same shapes are in the way.
AROUND = 0.7
LIFT = 0.02
TILT = 0.01
# Scans are worked out so many at once at most.
TOGETHER = 16


@dataclass(frozen=True, slots=True)
class Near:
    """Shapes that beams may meet near `origin` (m), with the lidar's vertical near `up`. `owners` (K,) are their models."""

    origin: Vector
    up: Vector
    shapes: Shapes
    owners: np.ndarray

    def has(self, place: Pose) -> bool:
        """Whether these are all shapes that a lidar at `place` may meet."""
        if math.dist(self.origin, place.position) > AROUND or math.dist(self.up, _up(place)) > TILT:
            return False
        lift = sum([(to - at) * part for to, at, part in zip(place.position, self.origin, self.up, strict=True)])
        return abs(lift) <= LIFT


class Taken(Scan):
    """A scan by `lidar` whose ranges are worked out only when somebody asks for them.

    It was taken from `place`, with the shapes `near`; `noise` (B,) m is that of its ranges.
    """

    __slots__ = ("lidar", "measured", "near", "noise", "place")

    def __init__(
        self, time: float, angles: np.ndarray, origin: Vector, lidar: Lidar, place: Pose, near: Near, noise: np.ndarray
    ) -> None:
        own = {"lidar": lidar, "place": place, "near": near, "noise": noise, "measured": None}
        for name, value in ({"time": time, "angles": angles, "origin": origin} | own).items():
            object.__setattr__(self, name, value)

    @property
    def ranges(self) -> np.ndarray:
        if self.measured is None:
            self.lidar.work_out(self)
        return self.measured

    def __reduce__(self) -> tuple[type[Scan], tuple[Any, ...]]:
        return Scan, (self.time, self.angles, self.ranges, self.origin)


class Lidar:
    """Measures the models of a world that are there, never the robot itself.

    `present` are their names, `moving` those of them that move.
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
        self._random = random
        self._fan = Fan.of(settings)
        self._names = obstacles.names
        self._first_seen: dict[str, float] = {}
        self._unseen = np.ones(len(obstacles.names), dtype=bool)

        there = np.array([name in present for name in obstacles.names], dtype=bool)
        (rows,) = there[obstacles.owners].nonzero()
        self._owners = obstacles.owners[rows]
        self._shapes = Shapes.of(obstacles, rows)
        (self._movers,) = (obstacles.links[rows] >= 0).nonzero()
        first = dict(zip((model.name for model in moving), _firsts(moving), strict=True))
        owners = [obstacles.names[owner] for owner in self._owners[self._movers]]
        self._links = obstacles.links[rows][self._movers] + np.array([first[name] for name in owners], dtype=int)
        # Those that beams may meet while the lidar is hardly elsewhere than where they were looked for.
        self._near: Near | None = None
        # Scans that may show a model for the first time.
        self._waiting: list[Taken] = []
        self._poses: tuple[np.ndarray, np.ndarray] | None = None
        # In the frames of their links, for as long as the run.
        self._centers = self._shapes.centers[:, self._movers]
        self._frames = self._shapes.frames[:, :, self._movers]

    @property
    def first_seen(self) -> dict[str, float]:
        """When (s) a beam first ended on each model, a ground among them."""
        self._work_out_waiting()
        return self._first_seen

    def scan(self, now: float, pose: tuple[float, ...], places: np.ndarray, turns: np.ndarray) -> Scan:
        """One turn at `now` (s).

        `pose` is x, y, z (m) and the quaternion w, x, y, z of the robot's first link; `places` (L, 3) m and `turns` (L, 3, 3)
        are the poses of all links of the moving models, model after model. All are in the world frame.
        """
        settings = self._settings
        mount = (settings.x, settings.y, settings.z)
        place = Pose(tuple(pose[:3]), tuple(pose[3:])) @ Pose(mount)
        if self._move(places, turns) or not (self._near and self._near.has(place)):
            self._work_out_waiting()
            self._near = self._near_by(place)
        # One draw for each beam, whatever it meets: what is removed elsewhere changes no other range.
        noise = self._random.standard_normal(len(self._fan.angles))
        taken = Taken(now, self._fan.angles, mount, self, place, self._near, noise)
        if self._unseen[self._near.owners].any():
            self._waiting.append(taken)
        if len(self._waiting) == TOGETHER:
            self._work_out_waiting()
        return taken

    def work_out(self, taken: Taken) -> None:
        """Works out the ranges of one of its scans."""
        self._work_out_waiting()
        if taken.measured is None:
            self._measure([taken])

    def _work_out_waiting(self) -> None:
        if self._waiting:
            waiting, self._waiting = self._waiting, []
            self._notice(waiting, self._measure(waiting))

    def _measure(self, scans: list[Taken]) -> Ends:
        """Where the beams of `scans`, taken with the same shapes near, end, from which they get their ranges."""
        settings = self._settings
        origins = np.array([taken.place.position for taken in scans])
        axes = np.array([taken.place.rotation() for taken in scans]).transpose(0, 2, 1)
        ends = cast(self._fan, scans[0].near.shapes, origins, axes)
        for taken, distances in zip(scans, ends.distances, strict=True):
            ranges = settings.noise * taken.noise
            ranges += distances
            ranges[(ranges < settings.nearest) | (ranges > settings.range)] = np.inf
            object.__setattr__(taken, "measured", ranges)
        return ends

    def _near_by(self, place: Pose) -> Near:
        """The shapes that beams may meet from `place`, or from where that is near."""
        origin, axes = np.array(place.position), place.rotation().T
        rows = in_the_way(self._fan, self._shapes, origin, axes, AROUND, LIFT, TILT)
        return Near(place.position, _up(place), self._shapes.take(rows), self._owners[rows])

    def _move(self, places: np.ndarray, turns: np.ndarray) -> bool:
        """Moves the shapes to where their links are; returns whether that is elsewhere than before."""
        if not len(self._movers):
            return False
        before, self._poses = self._poses, (places.copy(), turns.copy())
        if before and np.array_equal(before[0], places) and np.array_equal(before[1], turns):
            return False
        turn = turns[self._links].transpose(1, 2, 0)
        first, second, third = (turn[:, axis] for axis in range(3))
        a, b, c = self._centers
        self._shapes.centers[:, self._movers] = first * a + second * b + third * c + places[self._links].T
        a, b, c = self._frames
        frames = first[:, None] * a + second[:, None] * b + third[:, None] * c
        self._shapes.frames[:, :, self._movers] = frames
        return True

    def _notice(self, scans: list[Taken], ends: Ends) -> None:
        """Remembers the models on which a beam ended that measured something, for the first time."""
        owners = scans[0].near.owners[ends.shapes]
        (fresh,) = self._unseen[owners].nonzero()
        count = len(self._fan.angles)
        for beam, owner in sorted(zip(ends.beams[fresh].tolist(), owners[fresh].tolist(), strict=True)):
            taken = scans[beam // count]
            if self._unseen[owner] and math.isfinite(taken.measured[beam % count]):
                self._unseen[owner] = False
                self._first_seen[self._names[owner]] = taken.time


def _up(place: Pose) -> Vector:
    w, x, y, z = place.quaternion
    return 2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)


def _firsts(models: Sequence[Model]) -> list[int]:
    """The number of each model's first link among those of all `models`."""
    return [0, *accumulate(len(model.links) for model in models)][:-1]
