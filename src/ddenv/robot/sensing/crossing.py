"""Where beams enter and leave shapes, each in the frame in which its shape is between -1 and 1 along each axis.

`start` (3, P) is where the beams start and `way` (3, P) how far they get in a metre. The answer is when they enter and leave the
shape, each (P,) m and below 0 behind their start; a beam that misses leaves before it enters.

A result never depends on what else is cast with it: only sums, products, quotients and roots of single numbers are taken,
which are the same wherever in an array they are.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ddenv.world.model import Mesh

# Added to what may be 0 and is divided by: a beam along a face crosses it, but far away. It changes nothing else.
NEVER = 1e-200
# The least part of its radius that half of a capsule's straight part is long.
SHORTEST = 1e-9

Interval = tuple[np.ndarray, np.ndarray]


def cube(start: np.ndarray, way: np.ndarray) -> Interval:
    """Of the cube from -1 to 1; with fewer rows than three, of what is between -1 and 1 along these axes alone."""
    metres = 1.0 / (way + NEVER)
    middle, half = start * metres, np.abs(metres)
    return -(middle + half).min(axis=0), (half - middle).min(axis=0)


def ball(start: np.ndarray, way: np.ndarray) -> Interval:
    """Of the ball with radius 1; with two rows, of the endless tube about the third axis."""
    speed = _dot(way, way) + NEVER
    nearest = -_dot(start, way) / speed
    # From the point of the beam that is nearest to the middle: from its start, far away, digits would be lost.
    point = start + nearest * way
    inside = 1.0 - _dot(point, point)
    half = np.sqrt(np.maximum(inside, 0.0) / speed)
    return nearest - half, np.where(inside < 0, -np.inf, nearest + half)


def tube(start: np.ndarray, way: np.ndarray) -> Interval:
    """Of the cylinder with radius 1 about the third axis, with its ends."""
    enter, leave = ball(start[:2], way[:2])
    below, above = cube(start[2:], way[2:])
    return np.maximum(enter, below), np.minimum(leave, above)


def pill(start: np.ndarray, way: np.ndarray, lengths: np.ndarray) -> Interval:
    """Of the capsule about the third axis whose half length is `lengths` (P,) times its radius."""
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


def _dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] if len(a) == 3 else a[0] * b[0] + a[1] * b[1]


@dataclass(frozen=True)
class Facets:
    """A convex mesh as what is behind all of its faces, in the frame in which it is between -1 and 1 along each axis.

    `corners` (3, V) are its vertices and `faces` (3, M) numbers of them. Of a point behind a face the product with the face's
    column of `normals` (3, M) is at most that of `offsets` (M,).
    """

    corners: np.ndarray
    faces: np.ndarray
    normals: np.ndarray
    offsets: np.ndarray

    @classmethod
    def of(cls, mesh: Mesh, middle: np.ndarray, half: np.ndarray) -> Facets:
        """Those of `mesh`, which is around `middle` (3,) and as large as twice `half` (3,), m."""
        corners = (mesh.vertices - middle) / half
        start, second, third = (corners[mesh.faces[:, number]] for number in range(3))
        normals = np.cross(second - start, third - start)
        sizes = np.sqrt((normals * normals).sum(axis=1))
        faces, normals = mesh.faces[sizes > 0], normals[sizes > 0] / sizes[sizes > 0, None]
        # The normal of a sliver may be wrong: with this offset it still cuts off no corner.
        offsets = (normals @ corners.T).max(axis=1)
        return cls(corners.T.copy(), faces.T.copy(), normals.T.copy(), offsets)

    def cast(self, start: np.ndarray, way: np.ndarray, normal: np.ndarray) -> Interval:
        """Where beams from `start` (3,) along `way` (3, P), at right angles to `normal` (3,), enter and leave, see `crossing`."""
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
