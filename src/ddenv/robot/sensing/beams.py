"""Casting beams: how far each of the beams of a lidar goes until it meets a shape.

All beams of a scan start in one point and lie in one plane, the x-y plane of the lidar. Each shape is met only with the beams
that point towards the box around it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ddenv.robot.sensing.crossing import Facets, Interval, ball, cube, pill, tube
from ddenv.robot.sensing.obstacles import HULL, KINDS, PILL, Obstacles
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

    @cached_property
    def firsts(self) -> list[int]:
        """Where each kind begins, and where the last one ends."""
        return self.kinds.searchsorted(BOUNDS).tolist()

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

    def take(self, rows: np.ndarray) -> Shapes:
        """The shapes `rows` (K,) alone, in this order."""
        return Shapes(
            kinds=self.kinds[rows],
            centers=self.centers.take(rows, axis=1),
            frames=self.frames.take(rows, axis=2),
            squares=self.squares.take(rows, axis=1),
            reaches=self.reaches[rows],
            lengths=self.lengths[rows],
            facets={new: self.facets[old] for new, old in enumerate(rows.tolist()) if old in self.facets},
        )


@dataclass(frozen=True)
class Ends:
    """Where the beams of S scans end: `distances` (S, B) m, infinite for those that meet nothing.

    Of each meeting (M,) `beams` is the beam, counted from the first of the first scan, `ways` how far away it is (m), and
    `shapes` the number of the shape.
    """

    distances: np.ndarray
    beams: np.ndarray
    ways: np.ndarray
    shapes: np.ndarray

    def first(self) -> tuple[np.ndarray, np.ndarray]:
        """The beams (N,) that end on something, and the shapes (N,) on which they end."""
        first = self.ways == self.distances.ravel()[self.beams]
        return self.beams[first], self.shapes[first]


def cast(fan: Fan, shapes: Shapes, origins: np.ndarray, axes: np.ndarray) -> Ends:
    """The beams of S scans from `origins` (S, 3) m, in the world as `axes` (S, 3, 3) are.

    Their angles count from the first of the axes towards the second. A shape around an origin is not met.
    """
    scans, count = len(origins), len(fan.angles)
    distances = np.full((scans, count), np.inf)
    local = _seen(shapes, origins, axes)
    # Half the edges of the boxes around the shapes, and their centers, along the lidar's first two axes.
    edges = local[1:3] * shapes.squares[:, :, None]
    centers = (edges * local[0]).sum(axis=1)
    seen = len(shapes.kinds) * scans
    local = local.reshape(4, 3, seen)
    counts, beams = fan.between(*_span(np.negative(centers, out=centers).reshape(2, seen), edges.reshape(2, 3, seen)))
    enter, leave = _cross(fan, shapes, local, counts, beams)
    np.minimum(leave, fan.range, out=leave)
    (met,) = ((enter >= 0) & (enter <= leave)).nonzero()
    numbers = np.arange(seen).repeat(counts)[met]
    beams, enter = beams[met], enter[met]
    if scans > 1:
        beams += numbers % scans * count
    np.minimum.at(distances.ravel(), beams, enter)
    return Ends(distances, beams, enter, numbers // scans)


def _seen(shapes: Shapes, origins: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """The lidar's place and its three axes as each shape sees them in each scan, (4, 3, K, S)."""
    view = np.empty((4, 3, len(shapes.kinds), len(origins)))
    np.subtract(origins.T[:, None], shapes.centers[:, :, None], out=view[0])
    view[1:] = axes.transpose(1, 2, 0)[:, :, None]
    frames = shapes.frames[..., None]
    local = view[:, :1] * frames[0]
    local += view[:, 1:2] * frames[1]
    local += view[:, 2:] * frames[2]
    return local


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


def _cross(fan: Fan, shapes: Shapes, local: np.ndarray, counts: np.ndarray, beams: np.ndarray) -> Interval:
    """Where `beams` (P,) enter and leave the shapes, of which each has `counts` (K * S,) of them, those of each scan in turn."""
    start, ahead, left = local[:3].repeat(counts, axis=2)
    ahead *= fan.cosines.take(beams)
    left *= fan.sines.take(beams)
    way = np.add(ahead, left, out=ahead)
    enter, leave = np.empty((2, len(beams)))
    ends = [0, *counts.cumsum().tolist()]
    scans = len(counts) // max(len(shapes.kinds), 1)
    firsts = [first * scans for first in shapes.firsts]
    bounds = [ends[first] for first in firsts]
    for kind, crossing in enumerate(CROSSINGS):
        part = slice(bounds[kind], bounds[kind + 1])
        if part.start < part.stop:
            enter[part], leave[part] = crossing(start[:, part], way[:, part])
    if bounds[PILL] < bounds[PILL + 1]:
        part = slice(bounds[PILL], bounds[PILL + 1])
        lengths = shapes.lengths.repeat(scans).repeat(counts)
        enter[part], leave[part] = pill(start[:, part], way[:, part], lengths[part])
    for one in range(firsts[HULL], len(counts)):
        part, shape = slice(ends[one], ends[one + 1]), one // scans
        normal = local[3, :, one] * shapes.squares[:, shape]
        enter[part], leave[part] = shapes.facets[shape].cast(local[0, :, one], way[:, part], normal)
    return enter, leave
