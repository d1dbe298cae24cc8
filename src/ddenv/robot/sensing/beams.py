"""The collision shapes of a world as arrays, and how far the beams of a lidar go until they hit
one.

Each shape has its own frame, in which it lies between -1 and 1 along each axis: there all boxes are
the same cube, and all spheres and ellipsoids the same ball. All beams of a scan start in one point
and lie in one plane, the x-y plane of the lidar. Each shape is tested only with the beams that
point towards the box around it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property, partial
from itertools import pairwise

import numpy as np

from ddenv.arrays import Booleans, Floats, Integers
from ddenv.text import Names
from ddenv.world.extent import shape_bounds
from ddenv.world.model import (
    Box,
    Capsule,
    Cylinder,
    Ellipsoid,
    Mesh,
    Plane,
    Shape,
    Sphere,
    Terrain,
    World,
    still_links,
)
from ddenv.world.pose import HERE, Pose, Vector, vector
from ddenv.world.scenario import Lidar
from ddenv.world.terrain import bilinear

# The kinds of shapes that are cast in the same way, in the order in which they are sorted.
CUBE, BALL, TUBE, PILL, HULL = KINDS = range(5)
KIND_OF = {
    Box: CUBE,
    Plane: CUBE,
    Sphere: BALL,
    Ellipsoid: BALL,
    Cylinder: TUBE,
    Capsule: PILL,
    Mesh: HULL,
    Terrain: HULL,
}
# Where each kind begins in a sorted array of kinds, and where the last one ends.
BOUNDS = np.arange(len(KINDS) + 1)
# A shape is skipped only if it is out of the way by at least this margin (m, rad, and as a part of
# the range), which is far larger than rounding errors.
SPARE = 1e-6
PLANE = 2e4  # a plane is the top of a cube of this size, m: what lies below it is inside
THINNEST = 1e-9  # the minimum half thickness of a shape, m
# Pieces of a mesh are cast as so much larger on each side, m: cutting leaves gaps of micrometres
# between them.
SEAM = 1e-4


@dataclass(frozen=True, kw_only=True)
class Shapes:
    """N shapes, sorted by kind, at some instant.

    `centers` (3, N) m are in the world frame. `frames` (3, 3, N) 1/m turn a vector along the
    world's axes (first index) into one along the shape's own axes (second index), in which the
    shape lies between -1 and 1. `squares` (3, N) m^2 are the squares of half the sizes, `reaches`
    (N,) m upper bounds of the distance from the center. `lengths` (N,) are the half lengths of
    capsules in units of their radius, `facets` the faces of meshes, and the surfaces of terrain, by
    the number of the shape.
    """

    kinds: Integers
    centers: Floats
    frames: Floats
    squares: Floats
    reaches: Floats
    lengths: Floats
    facets: Mapping[int, Facets | Relief]

    @cached_property
    def firsts(self) -> list[int]:
        """Where each kind begins, and where the last one ends."""
        firsts: list[int] = self.kinds.searchsorted(BOUNDS).tolist()
        return firsts

    def take(self, rows: Integers) -> Shapes:
        """The shapes `rows` (K,) alone, in this order."""
        return Shapes(
            kinds=self.kinds[rows],
            centers=self.centers.take(rows, axis=1),
            frames=self.frames.take(rows, axis=2),
            squares=self.squares.take(rows, axis=1),
            reaches=self.reaches[rows],
            lengths=self.lengths[rows],
            facets={
                new: self.facets[old] for new, old in enumerate(rows.tolist()) if old in self.facets
            },
        )


@dataclass(frozen=True)
class Obstacles:
    """All N collision shapes of a world, sorted by kind.

    `names` are the world's models, `owners` (N,) the index of each shape's model in `names`.
    `links` (N,) is the index of the shape's link in its model, -1 for a shape that never moves.
    `shapes` on moving links are still in their link's frame.
    """

    names: Names
    owners: Integers
    links: Integers
    shapes: Shapes

    @classmethod
    def of(cls, world: World) -> Obstacles:
        found: list[tuple[int, int, Shape, Pose, float]] = []
        for owner, model in enumerate(world.models):
            still = {link.name for link in still_links(model)}
            for number, link in enumerate(model.links):
                fixed = link.name in still
                frame = Pose() if fixed else link.pose.inverse()
                for one in link.collisions:
                    pose = frame @ one.pose @ Pose(_extent(one.shape)[0])
                    more = 0.0 if one.piece is None else SEAM
                    found.append((owner, -1 if fixed else number, one.shape, pose, more))
        found.sort(key=lambda one: KIND_OF[type(one[2])])
        owners, links, shapes, poses, grown = (
            zip(*found, strict=True) if found else ((), (), (), (), ())
        )
        sizes = np.maximum(
            np.array([_extent(shape)[1] for shape in shapes]).reshape(-1, 3), THINNEST
        )
        sizes += np.array(grown).reshape(-1, 1)
        halves = sizes.T.copy()
        squares = halves * halves
        turns = np.array([pose.rotation() for pose in poses]).reshape(-1, 3, 3).transpose(1, 2, 0)
        arrays = Shapes(
            kinds=np.array([KIND_OF[type(shape)] for shape in shapes], dtype=int),
            centers=np.array([pose.position for pose in poses]).reshape(-1, 3).T.copy(),
            frames=turns / halves,
            squares=squares,
            reaches=np.sqrt(squares.sum(axis=0)) + SPARE,
            lengths=sizes[:, 2] / sizes[:, 0],
            facets={
                number: kind.of(shape, np.array(_extent(shape)[0]), sizes[number])
                for number, shape in enumerate(shapes)
                if (kind := CURVED.get(type(shape))) is not None
            },
        )
        names = world.names
        return cls(names, np.array(owners, dtype=int), np.array(links, dtype=int), arrays)


def _extent(shape: Shape) -> tuple[Vector, Vector]:
    """Of the box around `shape` along its own axes: the middle, and half the size, m."""
    if isinstance(shape, Plane):
        return (0.0, 0.0, -PLANE / 2), (PLANE / 2, PLANE / 2, PLANE / 2)
    low, high = shape_bounds(shape, HERE)
    return vector((low + high) / 2), vector((high - low) / 2)


# Added to divisors that may be 0: a beam along a face then crosses it, but far away. It is too
# small to change anything else.
NEVER = 1e-200
# In how many steps a beam is followed along terrain.
FEWEST_STEPS = 20
MOST_STEPS = 200
SHORTEST = 1e-9  # the minimum half length of a capsule's straight part, as a part of its radius

Interval = tuple[Floats, Floats]


def cube(start: Floats, way: Floats) -> Interval:
    """The cube from -1 to 1; with fewer than three rows, what lies between -1 and 1 along these
    axes alone.
    """
    metres = 1.0 / (way + NEVER)
    middle = start * metres
    half = np.abs(metres)
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
    start = start.copy()
    way = way.copy()
    start[2] *= lengths
    way[2] *= lengths
    ends = np.maximum(lengths - 1.0, SHORTEST)
    parts = [
        tube(
            np.stack([start[0], start[1], start[2] / ends]),
            np.stack([way[0], way[1], way[2] / ends]),
        )
    ]
    for end in (-ends, ends):
        parts.append(ball(np.stack([start[0], start[1], start[2] - end]), way))
    missed = [enter > leave for enter, leave in parts]
    enters = [np.where(miss, np.inf, enter) for miss, (enter, _) in zip(missed, parts, strict=True)]
    leaves = [
        np.where(miss, -np.inf, leave) for miss, (_, leave) in zip(missed, parts, strict=True)
    ]
    return np.min(enters, axis=0), np.max(leaves, axis=0)


def _dot(a: Floats, b: Floats) -> Floats:
    dot: Floats = (
        a[0] * b[0] + a[1] * b[1] + a[2] * b[2] if len(a) == 3 else a[0] * b[0] + a[1] * b[1]
    )
    return dot


@dataclass(frozen=True, kw_only=True)
class Facets:
    """A convex mesh as the intersection of the half spaces behind its faces, in the frame in which
    it lies between -1 and 1.

    `corners` (3, V) are its vertices, `faces` (3, M) indices of vertices. A point p is behind face
    m if `normals[:, m] @ p <= offsets[m]`; `normals` (3, M), `offsets` (M,). It is larger than the
    hull of its corners by a box of half the size `spare` (3,).
    """

    corners: Floats
    faces: Integers
    normals: Floats
    offsets: Floats
    spare: Floats

    @classmethod
    def of(cls, mesh: Mesh, middle: Floats, half: Floats) -> Facets:
        """The facets of `mesh`, whose box has its centre at `middle` (3,) m; it is made larger, to
        half the size `half` (3,) m.
        """
        corners = (mesh.vertices - middle) / half
        spare = 1.0 - np.abs(corners).max(axis=0)
        start, second, third = (corners[mesh.faces[:, number]] for number in range(3))
        normals = np.cross(second - start, third - start)
        sizes = np.sqrt((normals * normals).sum(axis=1))
        faces = mesh.faces[sizes > 0]
        normals = normals[sizes > 0] / sizes[sizes > 0, None]
        # A sliver's normal may be wrong: with this offset its face still cuts off no vertex.
        offsets = (normals @ corners.T).max(axis=1) + np.abs(normals) @ spare
        return cls(
            corners=corners.T.copy(),
            faces=faces.T.copy(),
            normals=normals.T.copy(),
            offsets=offsets,
            spare=spare,
        )

    def cast(self, start: Floats, way: Floats, normal: Floats, _range: float) -> Interval:
        """Where beams from `start` (3,) along `way` (3, P), orthogonal to `normal` (3,), enter and
        leave.
        """
        corners = self.corners - start[:, None]
        heights = (normal[0] * corners[0] + normal[1] * corners[1] + normal[2] * corners[2])[
            self.faces
        ]
        more = np.abs(normal) @ self.spare
        (cut,) = ((heights.min(axis=0) <= more) & (heights.max(axis=0) >= -more)).nonzero()
        if not len(cut):
            return np.full(way.shape[1], np.inf), np.full(way.shape[1], -np.inf)
        out = self.normals.take(cut, axis=1)[:, :, None]
        above = out[0] * start[0] + out[1] * start[1] + out[2] * start[2] - self.offsets[cut, None]
        rise = out[0] * way[0] + out[1] * way[1] + out[2] * way[2] + NEVER
        crossing = -above / rise
        enter = np.where(rise < 0, crossing, -np.inf).max(axis=0)
        return enter, np.where(rise > 0, crossing, np.inf).min(axis=0)


@dataclass(frozen=True)
class Relief:
    """Terrain in the frame in which it lies between -1 and 1: all that is below `heights` (R, C).
    Its cells are `cell` m wide.
    """

    heights: Floats
    cell: float

    @classmethod
    def of(cls, terrain: Terrain, middle: Floats, half: Floats) -> Relief:
        """The relief of terrain, whose box has its centre at `middle` (3,) m and half the size
        `half` (3,) m.
        """
        counts = np.array(terrain.heights.shape[::-1]) - 1
        return cls(
            (terrain.heights - middle[2]) / half[2], float((np.array(terrain.size) / counts).min())
        )

    def cast(self, start: Floats, way: Floats, _normal: Floats, reach: float) -> Interval:
        """Where beams from `start` (3,) along `way` (3, P), which are `reach` m long, meet the
        surface; they do not leave it.
        """
        along = np.linspace(0.0, reach, int(np.clip(reach / self.cell, FEWEST_STEPS, MOST_STEPS)))
        x, y, z = start[:, None, None] + along[:, None] * way[:, None]
        rows, columns = self.heights.shape
        above = z - bilinear(self.heights, (y + 1) / 2 * (rows - 1), (x + 1) / 2 * (columns - 1))
        under: Booleans = above <= 0
        first = under.argmax(axis=0)
        beam = np.arange(way.shape[1])
        before = above[first - 1, beam]
        after = above[first, beam]
        enter = along[first] - along[1] * after / (after - before + NEVER)
        # A beam that begins below the surface does not meet it, nor does one that comes from below
        # the terrain's edge.
        met = under.any(axis=0) & (before > 0)
        return np.where(met, enter, np.inf), np.where(met, np.inf, -np.inf)


CURVED: dict[type, type[Facets] | type[Relief]] = {Mesh: Facets, Terrain: Relief}


TURNS = np.array(
    [[-math.tau], [0.0], [math.tau]]
)  # directions that differ by a full turn are the same


@dataclass(frozen=True, kw_only=True)
class Fan:
    """The B beams of a lidar: `angles` (B,) rad, their `cosines` and `sines` (B,), `step` rad
    between two, `range` m long.
    """

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
        return cls(angles=shared, cosines=cosines, sines=sines, step=step, range=settings.range)

    def between(self, middle: Floats, half: Floats) -> tuple[Integers, Integers]:
        """The beams within `half` (K,) rad of the angles `middle` (K,) rad: how many for each (K,),
        and the numbers of all (P,).
        """
        number = (middle - self.angles[0] + TURNS) / self.step
        width = half / self.step
        first = np.maximum(np.ceil(number - width), 0.0).astype(int).T.ravel()
        last = np.minimum(np.floor(number + width), len(self.angles) - 1.0).astype(int).T.ravel()
        counts = np.maximum(last - first + 1, 0)
        ends = counts.cumsum()
        beams = (first - ends + counts).repeat(counts)
        return counts.reshape(-1, 3).sum(axis=1), beams + np.arange(len(beams))


def cast(
    fan: Fan, shapes: Shapes, origin: Floats, axes: Floats
) -> tuple[Floats, Integers, Integers]:
    """Casts the beams of one scan from `origin` (3,) m, in the world frame; `axes` (3, 3) are the
    lidar's axes, as rows.

    Returns how far the beams go, (B,) m, infinite where they hit nothing; the numbers (N,) of the
    beams that end on a shape; and those of the shapes (N,). Angles count from the first axis
    towards the second. A beam does not hit a shape that it starts in.
    """
    # The lidar's position and its three axes in the frame of each shape, (4, 3, K).
    view = np.empty((4, 3, len(shapes.kinds)))
    np.subtract(origin[:, None], shapes.centers, out=view[0])
    view[1:] = axes[:, :, None]
    frames = shapes.frames
    local: Floats = view[:, :1] * frames[0] + view[:, 1:2] * frames[1] + view[:, 2:] * frames[2]
    # Half the edges of the boxes around the shapes, and their centers, along the lidar's first two
    # axes.
    edges = local[1:3] * shapes.squares
    centers = (edges * local[0]).sum(axis=1)
    counts, beams = fan.between(*_span(-centers, edges))
    enter, leave = _cross(fan, shapes, local, counts, beams)
    np.minimum(leave, fan.range, out=leave)
    (met,) = ((enter >= 0) & (enter <= leave)).nonzero()
    beams = beams[met]
    enter = enter[met]
    numbers = np.arange(len(counts)).repeat(counts)[met]
    distances = np.full(len(fan.angles), np.inf)
    np.minimum.at(distances, beams, enter)
    first = enter == distances[beams]
    return distances, beams[first], numbers[first]


def _span(centers: Floats, edges: Floats) -> tuple[Floats, Floats]:
    """The angles at which boxes are seen from the origin: the middle and half the width, (K,) rad
    each.

    Along the lidar's axes, `centers` (3, K) m are the boxes' centers, and `edges` (3, 3, K) m half
    their edges, one for each of the box's axes (second index).
    """
    distance = np.sqrt(centers[0] * centers[0] + centers[1] * centers[1])
    x, y = centers[:2] / np.maximum(distance, SPARE)
    deep = np.abs(edges[0] * x + edges[1] * y).sum(axis=0)
    wide = np.abs(edges[1] * x - edges[0] * y).sum(axis=0)
    gap = distance - deep - SPARE
    return np.arctan2(y, x), np.where(gap > 0, np.arctan2(wide, gap), math.pi) + SPARE


def _cross(fan: Fan, shapes: Shapes, local: Floats, counts: Integers, beams: Integers) -> Interval:
    """Where `beams` (P,) enter and leave the shapes; `counts` (K,) says how many of the beams
    belong to each shape, in order.
    """
    start, ahead, left = local[:3].repeat(counts, axis=2)
    # In place: the system gives large new arrays slowly.
    ahead *= fan.cosines.take(beams)
    left *= fan.sines.take(beams)
    way = np.add(ahead, left, out=ahead)
    enter, leave = np.empty((2, len(beams)))
    ends = [0, *counts.cumsum().tolist()]
    parts = [slice(ends[first], ends[last]) for first, last in pairwise(shapes.firsts)]
    lengths = shapes.lengths.repeat(counts)[parts[PILL]]
    crossings: tuple[Callable[[Floats, Floats], Interval], ...] = (
        cube,
        ball,
        tube,
        partial(pill, lengths=lengths),
    )
    for part, crossing in zip(parts, crossings, strict=False):
        if part.start < part.stop:
            enter[part], leave[part] = crossing(start[:, part], way[:, part])
    for number, facets in shapes.facets.items():
        part = slice(ends[number], ends[number + 1])
        normal = local[3, :, number] * shapes.squares[:, number]
        enter[part], leave[part] = facets.cast(local[0, :, number], way[:, part], normal, fan.range)
    return enter, leave
