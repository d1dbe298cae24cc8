"""Where beams enter and leave shapes, in a frame in which the shape lies between -1 and 1 along each axis.

`start` (3, P) are the starts of the beams, `way` (3, P) their directions: how far they get in a metre. Each function returns the
distances (P,) m at which the beams enter and leave the shape, negative behind the start. A beam that misses the shape leaves before
it enters.

A result does not depend on what else is cast in the same call: it takes only sums, products, quotients and roots of single numbers,
which are the same wherever in an array these are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ddenv.arrays import Floats, Integers
from ddenv.world.model import Mesh

# Added to divisors that may be 0: a beam along a face then crosses it, but far away. It is too small to change anything else.
NEVER = 1e-200
# The minimum half length of a capsule's straight part, as a part of its radius.
SHORTEST = 1e-9

Interval = tuple[Floats, Floats]


def cube(start: Floats, way: Floats) -> Interval:
    """The cube from -1 to 1; with fewer than three rows, what lies between -1 and 1 along these axes alone."""
    metres = 1.0 / (way + NEVER)
    middle, half = start * metres, np.abs(metres)
    return -(middle + half).min(axis=0), (half - middle).min(axis=0)


def ball(start: Floats, way: Floats) -> Interval:
    """The ball of radius 1; with two rows, the endless cylinder about the third axis."""
    speed = _dot(way, way) + NEVER
    nearest = -_dot(start, way) / speed
    # From the point of the beam nearest to the centre: seen from a far start, digits would be lost.
    point = start + nearest * way
    inside = 1.0 - _dot(point, point)
    half = np.sqrt(np.maximum(inside, 0.0) / speed)
    return nearest - half, np.where(inside < 0, -np.inf, nearest + half)


def tube(start: Floats, way: Floats) -> Interval:
    """The cylinder of radius 1 about the third axis, with its end faces."""
    enter, leave = ball(start[:2], way[:2])
    below, above = cube(start[2:], way[2:])
    return np.maximum(enter, below), np.minimum(leave, above)


def pill(start: Floats, way: Floats, lengths: Floats) -> Interval:
    """The capsule about the third axis whose half length is `lengths` (P,) times its radius."""
    start, way = start.copy(), way.copy()
    start[2] *= lengths
    way[2] *= lengths
    ends = np.maximum(lengths - 1.0, SHORTEST)
    parts = [tube(np.stack([start[0], start[1], start[2] / ends]), np.stack([way[0], way[1], way[2] / ends]))]
    for end in (-ends, ends):
        parts.append(ball(np.stack([start[0], start[1], start[2] - end]), way))
    missed = [enter > leave for enter, leave in parts]
    enters = [np.where(miss, np.inf, enter) for miss, (enter, _) in zip(missed, parts, strict=True)]
    leaves = [np.where(miss, -np.inf, leave) for miss, (_, leave) in zip(missed, parts, strict=True)]
    return np.min(enters, axis=0), np.max(leaves, axis=0)


def _dot(a: Floats, b: Floats) -> Floats:
    dot: Floats = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] if len(a) == 3 else a[0] * b[0] + a[1] * b[1]
    return dot


@dataclass(frozen=True)
class Facets:
    """A convex mesh as the intersection of the half spaces behind its faces, in the frame in which it lies between -1 and 1.

    `corners` (3, V) are its vertices, `faces` (3, M) indices of vertices. A point p is behind face m if
    `normals[:, m] @ p <= offsets[m]`; `normals` (3, M), `offsets` (M,).
    """

    corners: Floats
    faces: Integers
    normals: Floats
    offsets: Floats

    @classmethod
    def of(cls, mesh: Mesh, middle: Floats, half: Floats) -> Facets:
        """The facets of `mesh`, whose box has its centre at `middle` (3,) m and half the size `half` (3,) m."""
        corners = (mesh.vertices - middle) / half
        start, second, third = (corners[mesh.faces[:, number]] for number in range(3))
        normals = np.cross(second - start, third - start)
        sizes = np.sqrt((normals * normals).sum(axis=1))
        faces, normals = mesh.faces[sizes > 0], normals[sizes > 0] / sizes[sizes > 0, None]
        # A sliver's normal may be wrong: with this offset its face still cuts off no vertex.
        offsets = (normals @ corners.T).max(axis=1)
        return cls(corners.T.copy(), faces.T.copy(), normals.T.copy(), offsets)

    def cast(self, start: Floats, way: Floats, normal: Floats) -> Interval:
        """Where beams from `start` (3,) along `way` (3, P), orthogonal to `normal` (3,), enter and leave."""
        corners = self.corners - start[:, None]
        heights = (normal[0] * corners[0] + normal[1] * corners[1] + normal[2] * corners[2])[self.faces]
        (cut,) = ((heights.min(axis=0) <= 0) & (heights.max(axis=0) >= 0)).nonzero()
        if not len(cut):
            return np.full(way.shape[1], np.inf), np.full(way.shape[1], -np.inf)
        out = self.normals.take(cut, axis=1)[:, :, None]
        above = out[0] * start[0] + out[1] * start[1] + out[2] * start[2] - self.offsets[cut, None]
        rise = out[0] * way[0] + out[1] * way[1] + out[2] * way[2] + NEVER
        crossing = -above / rise
        enter = np.where(rise < 0, crossing, -np.inf).max(axis=0)
        return enter, np.where(rise > 0, crossing, np.inf).min(axis=0)
