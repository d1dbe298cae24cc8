"""Which shapes are in the way of a lidar's beams: those of them that it can meet anywhere near need not be looked for again."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ddenv.robot.sensing.beams import SPARE, Fan, Shapes
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
