"""Casts the beams of a lidar: how far each one goes until it hits a shape.

All beams of a scan start in one point and lie in one plane, the x-y plane of the lidar. Each shape is tested only with the beams
that point towards the box around it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ddenv.arrays import Floats, Integers
from ddenv.robot.sensing.obstacles import HULL, PILL, SPARE, Interval, Shapes, ball, cube, pill, tube
from ddenv.world.scenario import Lidar

CROSSINGS = (cube, ball, tube)
# Directions that differ by a full turn are the same.
TURNS = np.array([[-math.tau], [0.0], [math.tau]])


@dataclass(frozen=True)
class Fan:
    """The B beams of a lidar: `angles` (B,) rad, their `cosines` and `sines` (B,), `step` rad between two, `range` m long."""

    angles: Floats
    cosines: Floats
    sines: Floats
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

    def between(self, middle: Floats, half: Floats) -> tuple[Integers, Integers]:
        """The beams within `half` (K,) rad of the angles `middle` (K,) rad: how many for each (K,), and the numbers of all (P,)."""
        number, width = (middle - self.angles[0] + TURNS) / self.step, half / self.step
        first = np.maximum(np.ceil(number - width), 0.0).astype(int).T.ravel()
        last = np.minimum(np.floor(number + width), len(self.angles) - 1.0).astype(int).T.ravel()
        counts = np.maximum(last - first + 1, 0)
        ends = counts.cumsum()
        beams = (first - ends + counts).repeat(counts)
        return counts.reshape(-1, 3).sum(axis=1), beams + np.arange(len(beams))


@dataclass(frozen=True)
class Ends:
    """Where the beams of S scans end: `distances` (S, B) m, infinite for beams that hit nothing.

    For each of M hits, of whatever shape along a beam, `beams` (M,) is the number of the beam, counted from the first beam of the
    first scan, `depths` (M,) the distance (m), and `shapes` (M,) the number of the shape.
    """

    distances: Floats
    beams: Integers
    depths: Floats
    shapes: Integers

    def first(self) -> tuple[Integers, Integers]:
        """The beams (N,) that end on a shape, and these shapes (N,)."""
        first = self.depths == self.distances.ravel()[self.beams]
        return self.beams[first], self.shapes[first]


def cast(fan: Fan, shapes: Shapes, origins: Floats, axes: Floats) -> Ends:
    """Casts the beams of S scans from `origins` (S, 3) m, in the world frame; `axes` (S, 3, 3) are the lidar's axes, as rows.

    Angles count from the first axis towards the second. A beam does not hit a shape that it starts in.
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


def _seen(shapes: Shapes, origins: Floats, axes: Floats) -> Floats:
    """The lidar's position and its three axes in the frame of each shape, for each scan, (4, 3, K, S)."""
    view = np.empty((4, 3, len(shapes.kinds), len(origins)))
    np.subtract(origins.T[:, None], shapes.centers[:, :, None], out=view[0])
    view[1:] = axes.transpose(1, 2, 0)[:, :, None]
    frames = shapes.frames[..., None]
    local = view[:, :1] * frames[0]
    local += view[:, 1:2] * frames[1]
    local += view[:, 2:] * frames[2]
    seen: Floats = local
    return seen


def _span(centers: Floats, edges: Floats) -> tuple[Floats, Floats]:
    """The angles at which boxes are seen from the origin: the middle and half the width, (K,) rad each.

    Along the lidar's axes, `centers` (3, K) m are the boxes' centers, and `edges` (3, 3, K) m half their edges, one for each of the
    box's axes (second index).
    """
    distance = np.sqrt(centers[0] * centers[0] + centers[1] * centers[1])
    x, y = centers[:2] / np.maximum(distance, SPARE)
    deep = np.abs(edges[0] * x + edges[1] * y).sum(axis=0)
    wide = np.abs(edges[1] * x - edges[0] * y).sum(axis=0)
    gap = distance - deep - SPARE
    return np.arctan2(y, x), np.where(gap > 0, np.arctan2(wide, gap), math.pi) + SPARE


def _cross(fan: Fan, shapes: Shapes, local: Floats, counts: Integers, beams: Integers) -> Interval:
    """Where `beams` (P,) enter and leave the shapes.

    `counts` (K * S,) says how many of the beams belong to each shape in each scan, in this order.
    """
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
