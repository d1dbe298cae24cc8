"""Casting beams: how far each of the beams of a lidar goes until it meets a shape.

All beams start in one point and lie in one plane, the x-y plane of the lidar. Shapes that this plane does not cut are left out,
and of the others each is met only with the beams that point towards the box around it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ddenv.robot.sensing.crossing import Interval, ball, cube, pill, tube
from ddenv.robot.sensing.obstacles import HULL, KINDS, PILL, Obstacles
from ddenv.robot.sensing.section import Facets
from ddenv.world.scenario import Lidar

# What is left out is at least this much out of the way (m, rad, and as a part of the range): far more than rounding does.
SPARE = 1e-6
CROSSINGS = (cube, ball, tube)
# Where each kind begins among sorted ones, and where the last one ends.
BOUNDS = np.arange(len(KINDS) + 1)
# A full turn more or less is the same direction.
TURNS = np.array([[-math.tau], [0.0], [math.tau]])


@dataclass(frozen=True)
class Fan:
    """The beams of a lidar: `angles` (B,) rad with their `cosines` and `sines` (B,), `step` rad between two, `range` m long."""

    angles: np.ndarray
    cosines: np.ndarray
    sines: np.ndarray
    step: float
    range: float

    @classmethod
    def of(cls, settings: Lidar) -> Fan:
        step = settings.angle / (settings.beams - 1)
        angles = [step * (number - (settings.beams - 1) / 2) for number in range(settings.beams)]
        cosines, sines = (np.array([of(angle) for angle in angles]) for of in (math.cos, math.sin))
        shared = np.array(angles)
        shared.setflags(write=False)
        return cls(shared, cosines, sines, step, settings.range)

    def between(self, middle: np.ndarray, half: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Which beams are within `half` of the angles `middle`, (K,) rad: how many (K,) of each, and the numbers (P,) of all."""
        number, width = (middle - self.angles[0] + TURNS) / self.step, half / self.step
        first = np.maximum(np.ceil(number - width), 0.0).astype(int).T.ravel()
        last = np.minimum(np.floor(number + width), len(self.angles) - 1.0).astype(int).T.ravel()
        counts = np.maximum(last - first + 1, 0)
        ends = counts.cumsum()
        beams = (first - ends + counts).repeat(counts)
        return counts.reshape(-1, 3).sum(axis=1), beams + np.arange(len(beams))


@dataclass(frozen=True)
class Shapes:
    """N shapes, sorted by kind, as they are at some instant; see `ddenv.robot.sensing.obstacles`.

    `centers` (3, N) m are in the world, `frames` (3, 3, N) 1/m turn what is along the world's axes (first) into what is along
    the shapes' own (second). `squares` (3, N) m^2 are those of half the sizes, `reaches` (N,) m is how far the shapes
    go from their centers, or more. `lengths` (N,) are half those of capsules of radius 1, `facets` those of meshes by
    their numbers.
    """

    kinds: np.ndarray
    centers: np.ndarray
    frames: np.ndarray
    squares: np.ndarray
    reaches: np.ndarray
    lengths: np.ndarray
    facets: Mapping[int, Facets]

    @classmethod
    def of(cls, obstacles: Obstacles, rows: np.ndarray) -> Shapes:
        """The shapes `rows` (N,) of `obstacles`; those on links that move are where they are in their link's frame."""
        halves = obstacles.halves[:, rows]
        squares = halves * halves
        return cls(
            kinds=obstacles.kinds[rows],
            centers=obstacles.centers[:, rows],
            frames=obstacles.turns[:, :, rows] / halves,
            squares=squares,
            reaches=np.sqrt(squares.sum(axis=0)) + SPARE,
            lengths=obstacles.lengths[rows],
            facets={new: obstacles.facets[old] for new, old in enumerate(rows.tolist()) if old in obstacles.facets},
        )


@dataclass(frozen=True)
class Ends:
    """Where beams end: `distances` (B,) m, infinite for those that meet nothing, and `beams` (M,) that met `shapes` (M,)."""

    distances: np.ndarray
    beams: np.ndarray
    shapes: np.ndarray


def cast(fan: Fan, shapes: Shapes, origin: np.ndarray, axes: np.ndarray) -> Ends:
    """The beams from `origin` (3,) m, whose angles count from the first of `axes` (3, 3) towards the second; all in the world.

    A shape around the origin is not met.
    """
    distances = np.full(len(fan.angles), np.inf)
    numbers, local, spans = _in_the_way(fan, shapes, origin, axes)
    counts, beams = fan.between(*spans)
    enter, leave = _cross(fan, shapes, numbers, local, counts, beams)
    (met,) = ((enter >= 0) & (enter <= np.minimum(leave, fan.range))).nonzero()
    beams, enter = beams[met], enter[met]
    np.minimum.at(distances, beams, enter)
    (nearest,) = (enter == distances[beams]).nonzero()
    return Ends(distances, beams[nearest], numbers.repeat(counts)[met[nearest]])


def _in_the_way(
    fan: Fan, shapes: Shapes, origin: np.ndarray, axes: np.ndarray
) -> tuple[np.ndarray, np.ndarray, tuple[np.ndarray, np.ndarray]]:
    """The numbers (K,) of the shapes that beams may meet, the lidar in their frames, and the angles at which they are.

    The lidar is its place and its three axes, (4, 3, K), the angles are the middle and half the width, (K,) rad each.
    """
    numbers = _within_reach(fan, shapes, origin, axes)
    view = np.empty((4, 3, len(numbers)))
    view[0] = origin[:, None] - shapes.centers.take(numbers, axis=1)
    view[1:] = axes[:, :, None]
    frames = shapes.frames.take(numbers, axis=2)
    local = view[:, :1] * frames[0] + view[:, 1:2] * frames[1] + view[:, 2:] * frames[2]
    # Half the edges of the boxes around the shapes, and their centers, along the lidar's axes.
    edges = local[1:] * shapes.squares.take(numbers, axis=1)
    centers = -(edges * local[0]).sum(axis=1)
    cut = np.abs(centers[2]) <= np.abs(edges[2]).sum(axis=0) + SPARE
    # How far the beams get along each of a shape's axes: a ground may be high enough, but farther than that.
    ways = np.sqrt(local[1] * local[1] + local[2] * local[2])
    cut &= (np.abs(local[0]) - 1.0 <= ways * (fan.range * (1.0 + SPARE)) + SPARE).all(axis=0)
    (kept,) = cut.nonzero()
    span = _span(centers.take(kept, axis=1), edges.take(kept, axis=2))
    return numbers[kept], local.take(kept, axis=2), span


def _within_reach(fan: Fan, shapes: Shapes, origin: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """The numbers of the shapes of which the balls around them are cut by the plane of the beams, within their range."""
    # A matrix product may be rounded otherwise among more shapes: nothing else is made of this one.
    ahead, left, above = axes @ (shapes.centers - origin[:, None])
    far = shapes.reaches + fan.range
    (numbers,) = ((np.abs(above) <= shapes.reaches) & (ahead * ahead + left * left <= far * far)).nonzero()
    return numbers


def _span(centers: np.ndarray, edges: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """At which angles boxes are seen from the origin: the middle and half the width, (K,) rad each.

    `centers` (3, K) m, and `edges` (3, 3, K) m with the box's axes second, are along the lidar's axes.
    """
    distance = np.sqrt(centers[0] * centers[0] + centers[1] * centers[1])
    x, y = centers[:2] / np.maximum(distance, SPARE)
    deep = np.abs(edges[0] * x + edges[1] * y).sum(axis=0)
    wide = np.abs(edges[1] * x - edges[0] * y).sum(axis=0)
    gap = distance - deep - SPARE
    return np.arctan2(y, x), np.where(gap > 0, np.arctan2(wide, gap), math.pi) + SPARE


def _cross(
    fan: Fan, shapes: Shapes, numbers: np.ndarray, local: np.ndarray, counts: np.ndarray, beams: np.ndarray
) -> Interval:
    """Where `beams` (P,) enter and leave the shapes `numbers` (K,), of which each has `counts` (K,) of them."""
    start, ahead, left = local[:3].repeat(counts, axis=2)
    way = ahead * fan.cosines[beams] + left * fan.sines[beams]
    enter, leave = np.empty((2, len(beams)))
    ends = [0, *counts.cumsum().tolist()]
    firsts = shapes.kinds[numbers].searchsorted(BOUNDS).tolist()
    bounds = [ends[first] for first in firsts]
    for kind, crossing in enumerate(CROSSINGS):
        part = slice(bounds[kind], bounds[kind + 1])
        if part.start < part.stop:
            enter[part], leave[part] = crossing(start[:, part], way[:, part])
    if bounds[PILL] < bounds[PILL + 1]:
        part = slice(bounds[PILL], bounds[PILL + 1])
        lengths = shapes.lengths[numbers].repeat(counts)[part]
        enter[part], leave[part] = pill(start[:, part], way[:, part], lengths)
    for one in range(firsts[HULL], len(numbers)):
        part = slice(ends[one], ends[one + 1])
        normal = local[3, :, one] * shapes.squares[:, numbers[one]]
        enter[part], leave[part] = shapes.facets[numbers[one]].cast(local[0, :, one], way[:, part], normal)
    return enter, leave
