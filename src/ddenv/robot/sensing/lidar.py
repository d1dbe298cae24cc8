"""The lidar of one run."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import accumulate
from typing import Any

import numpy as np

from ddenv.robot.sensing.beams import SPARE, Ends, Fan, Shapes, cast
from ddenv.robot.sensing.obstacles import Obstacles
from ddenv.robot.sensing.sensors import Scan
from ddenv.world import scenario
from ddenv.world.model import Model
from ddenv.world.pose import Pose, Vector

# Near is at most so far away (m), so much of it upwards (m), and so much tilted (rad).
AROUND = 0.7
LIFT = 0.04
TILT = 0.02


@dataclass(frozen=True, slots=True)
class Near:
    """All shapes that beams may meet from `place`, or with `calm` near it. `owners` (K,) are their models."""

    place: Pose
    calm: bool
    shapes: Shapes
    owners: np.ndarray

    @classmethod
    def of(cls, fan: Fan, shapes: Shapes, owners: np.ndarray, place: Pose, calm: bool) -> Near:
        """Those of `shapes`, which belong to `owners` (N,)."""
        rows = in_the_way(fan, shapes, np.array(place.position), place.rotation().T, float(calm))
        return cls(place, calm, shapes.take(rows), owners[rows])

    def has(self, place: Pose) -> bool:
        """Whether these are all shapes that a lidar at `place` may meet."""
        return self.calm and are_near(self.place, place)


def are_near(one: Pose, other: Pose, part: float = 1.0) -> bool:
    """Whether places are near to each other, or as little as `part` of that."""
    up = _up(one)
    if math.dist(one.position, other.position) > part * AROUND or math.dist(up, _up(other)) > part * TILT:
        return False
    lift = sum([(to - at) * along for to, at, along in zip(other.position, one.position, up, strict=True)])
    return abs(lift) <= part * LIFT


def in_the_way(fan: Fan, shapes: Shapes, origin: np.ndarray, axes: np.ndarray, part: float) -> np.ndarray:
    """The numbers (K,) of the shapes that the plane of the beams may cut within their range.

    The first two of `axes` (3, 3) lie in that plane. It goes through `origin` (3,), or what is as near as `part` of near.
    """
    around, lift, tilt = part * AROUND, part * LIFT, part * TILT
    numbers = _within_reach(fan, shapes, origin, axes, around, lift, tilt)
    frames, away = shapes.frames.take(numbers, axis=2), origin[:, None] - shapes.centers.take(numbers, axis=1)
    local = (away[:, None] * frames).sum(axis=0)
    up = (axes[2][:, None, None] * frames).sum(axis=0)
    # Half the edges of the boxes around the shapes, and their centers, along the lidar's vertical.
    edges = up * shapes.squares.take(numbers, axis=1)
    tilted = tilt * (np.sqrt((away * away).sum(axis=0)) + around + 2 * shapes.reaches[numbers])
    cut = np.abs((edges * local).sum(axis=0)) <= np.abs(edges).sum(axis=0) + tilted + lift + SPARE
    # How far the beams get along each of a shape's axes: a ground may be high enough, but farther than that.
    squares = (frames * frames).sum(axis=0)
    ways = np.sqrt(np.maximum(squares - up * up, 0.0)) + tilt * np.sqrt(squares)
    far = ways * (fan.range * (1.0 + SPARE) + around) + lift * np.abs(up) + SPARE
    return numbers[cut & (np.abs(local) - 1.0 <= far).all(axis=0)]


def _within_reach(
    fan: Fan, shapes: Shapes, origin: np.ndarray, axes: np.ndarray, around: float, lift: float, tilt: float
) -> np.ndarray:
    """The numbers of the shapes of which the balls around them are cut by the plane of the beams, within their range."""
    # A matrix product may be rounded otherwise among more shapes: nothing else is made of this one.
    ahead, left, above = axes @ (shapes.centers - origin[:, None])
    flat, high = ahead * ahead + left * left, np.abs(above)
    tallest = shapes.reaches + lift + tilt * (np.sqrt(flat + high * high) + around)
    # A tilt brings what is above and below by so much nearer in the plane.
    far = (shapes.reaches + (fan.range + around) + tilt * (high + around)) * (1.0 + tilt * tilt)
    (numbers,) = ((high <= tallest) & (flat <= far * far)).nonzero()
    return numbers


def _up(place: Pose) -> Vector:
    """The vertical of `place`."""
    w, x, y, z = place.quaternion
    return 2 * (x * z + w * y), 2 * (y * z - w * x), 1 - 2 * (x * x + y * y)


# Turns are worked out so many at once at most.
TOGETHER = 16
# Where it goes no farther from one turn to the next than this part of near, it looks for what is near there.
CALM = 0.5
# How many random numbers are set aside for the noise of each turn.
DRAWS = 2**40


@dataclass(slots=True, eq=False)
class Turn:
    """The turn `number` of a lidar, at `time` (s): where it is, what its beams may meet, and the ranges once they are known."""

    time: float
    number: int
    place: Pose
    near: Near
    ranges: np.ndarray | None = None


class Taken(Scan):
    """A scan whose `ranges` are worked out only when somebody asks for them, by what is given for them."""

    __slots__ = ("_ranges",)

    def __init__(
        self, time: float, angles: np.ndarray, ranges: Callable[[], np.ndarray] | np.ndarray, origin: Vector
    ) -> None:
        object.__setattr__(self, "time", time)
        object.__setattr__(self, "angles", angles)
        object.__setattr__(self, "_ranges", ranges)
        object.__setattr__(self, "origin", origin)

    @property
    def ranges(self) -> np.ndarray:
        return self._ranges() if callable(self._ranges) else self._ranges

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
        self._mount = Pose((settings.x, settings.y, settings.z))
        self._random = random
        self._state = random.bit_generator.state
        self._turns = 0
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
        self._place: Pose | None = None
        # Whether one of them was not seen yet, and the turns that may show it.
        self._may_notice = True
        self._waiting: list[Turn] = []
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
        place = Pose(pose[:3], pose[3:]) @ self._mount
        moved, before, self._place = self._move(places, turns), self._place, place
        if moved or not (self._near and self._near.has(place)):
            self._work_out_waiting()
            calm = not moved and before is not None and are_near(before, place, CALM)
            self._near = Near.of(self._fan, self._shapes, self._owners, place, calm)
            self._may_notice = bool(self._unseen[self._near.owners].any())
        turn = Turn(now, self._turns, place, self._near)
        self._turns += 1
        if self._may_notice:
            self._waiting.append(turn)
        if len(self._waiting) == TOGETHER:
            self._work_out_waiting()
        return Taken(now, self._fan.angles, partial(self._ranges, turn), self._mount.position)

    def _ranges(self, turn: Turn) -> np.ndarray:
        if turn.ranges is None:
            self._work_out_waiting()
        if turn.ranges is None:
            self._measure([turn])
        return turn.ranges

    def _work_out_waiting(self) -> None:
        if self._waiting:
            waiting, self._waiting = self._waiting, []
            self._notice(waiting, self._measure(waiting))
            self._may_notice = bool(self._unseen[self._near.owners].any())

    def _measure(self, turns: list[Turn]) -> Ends:
        """Where the beams of `turns`, with the same shapes near, end, from which they get their ranges."""
        nearest, farthest = self._settings.nearest, self._settings.range
        origins = np.array([turn.place.position for turn in turns])
        axes = np.array([turn.place.rotation() for turn in turns]).transpose(0, 2, 1)
        ends = cast(self._fan, turns[0].near.shapes, origins, axes)
        for turn, distances in zip(turns, ends.distances, strict=True):
            ranges = self._noise(turn.number) + distances
            ranges[(ranges < nearest) | (ranges > farthest)] = np.inf
            turn.ranges = ranges
        return ends

    def _noise(self, number: int) -> np.ndarray:
        """What is wrong with the ranges of a turn, (B,) m: the same whatever beams meet, and whatever else is asked for."""
        bits = self._random.bit_generator
        bits.state = self._state
        bits.advance(number * DRAWS)
        return self._settings.noise * self._random.standard_normal(len(self._fan.angles))

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

    def _notice(self, turns: list[Turn], ends: Ends) -> None:
        """Remembers the models on which a beam ended that measured something, for the first time."""
        beams, shapes = ends.first()
        owners = turns[0].near.owners[shapes]
        (fresh,) = self._unseen[owners].nonzero()
        count = len(self._fan.angles)
        for beam, owner in sorted(zip(beams[fresh].tolist(), owners[fresh].tolist(), strict=True)):
            turn = turns[beam // count]
            if self._unseen[owner] and math.isfinite(turn.ranges[beam % count]):
                self._unseen[owner] = False
                self._first_seen[self._names[owner]] = turn.time


def _firsts(models: Sequence[Model]) -> list[int]:
    """The number of each model's first link among those of all `models`."""
    return [0, *accumulate(len(model.links) for model in models)][:-1]
