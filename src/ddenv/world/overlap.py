"""How far two convex shapes overlap, or how far they are apart."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from ddenv.world.model import Box, Capsule, Collision, Cylinder, Ellipsoid, Mesh, Shape, Sphere
from ddenv.world.pose import Pose

# Sides of the prism that stands for a cylinder, and meridians of the ball that stands for an ellipsoid.
SIDES = 16
# Relative tolerance of lengths and of differences between normals.
SMALL = 1e-9
_NO_FACES = np.empty((0, 3)), np.empty(0, dtype=int), np.empty((0, 2), dtype=int), np.empty((0, 2), dtype=int)


@dataclass(frozen=True)
class Hull:
    """A convex body: the hull of `vertices` (N, 3) m, grown by `radius` m.

    `normals` (F, 3) are the outward unit normals of its faces, `on` (F,) the index of one vertex on each face, `edges` (E, 2)
    vertex indices, and `sides` (E, 2) the indices of the two normals beside each edge.
    """

    vertices: np.ndarray
    normals: np.ndarray
    on: np.ndarray
    edges: np.ndarray
    sides: np.ndarray
    radius: float = 0.0

    def span(self, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest coordinate along each unit vector of `axes`, shape (M, 3)."""
        along = axes @ self.vertices.T
        return along.min(axis=1) - self.radius, along.max(axis=1) + self.radius

    def at(self, pose: Pose) -> Hull:
        """This body, given in the frame `pose`, seen from that frame's parent."""
        turn = pose.rotation().T
        return replace(self, vertices=self.vertices @ turn + pose.position, normals=self.normals @ turn)


def hull(collision: Collision, place: Pose | None = None) -> Hull:
    """The convex body of a collision shape other than a plane, moved by `place`."""
    pose = collision.pose if place is None else place @ collision.pose
    return _own(collision.shape).at(pose)


def overlap(a: Hull, b: Hull) -> float:
    """The shortest move that separates two convex bodies, m; 0 if they do not overlap."""
    grown = a.radius + b.radius
    # Directions of faces and edges suffice, except for round bodies.
    apart = distance(a, b) if grown else 0.0
    return max(0.0, grown - apart if apart else _depth(a, b))


def distance(a: Hull, b: Hull) -> float:
    """The distance between the hulls of the vertices, m; 0 if they touch (Gilbert, Johnson and Keerthi)."""
    simplex = a.vertices[:1] - b.vertices[:1]
    for _ in range(100):
        nearest, simplex = _nearest(simplex)
        squared = float(nearest @ nearest)
        if squared < SMALL**2:
            return 0.0
        support = a.vertices[np.argmin(a.vertices @ nearest)] - b.vertices[np.argmax(b.vertices @ nearest)]
        if squared - nearest @ support <= SMALL * squared:
            break
        simplex = np.vstack([simplex, support])
    return math.sqrt(squared)


def _own(shape: Shape) -> Hull:
    """The body of a shape, in its own frame."""
    match shape:
        case Box(size):
            return replace(_CUBE, vertices=_CUBE.vertices * size)
        case Cylinder(radius, length):
            return replace(_PRISM, vertices=_PRISM.vertices * (radius, radius, length))
        case Sphere(radius):
            return Hull(np.zeros((1, 3)), *_NO_FACES, radius)
        case Capsule(radius, length):
            return replace(_SEGMENT, vertices=_SEGMENT.vertices * (0, 0, length), radius=radius)
        case Ellipsoid(radii):
            return _solid(_BALL[0] * radii, _BALL[1])
        case Mesh():
            return _solid(shape.vertices, shape.faces)
    raise TypeError(type(shape).__name__)


def _solid(vertices: np.ndarray, faces: np.ndarray) -> Hull:
    """The body of a closed convex surface of triangles (M, 3), counterclockwise seen from outside."""
    corners = vertices[faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(normals, axis=1)
    # Slivers have no usable normal; their neighbours bound the body without them.
    good = areas > SMALL * areas.max()
    faces, normals = faces[good], np.round(normals[good] / areas[good, None], 6)
    normals, first, which = np.unique(normals, axis=0, return_index=True, return_inverse=True)
    ends = np.sort(faces[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    beside = np.repeat(which.reshape(-1), 3)
    order = np.lexsort((ends[:, 1], ends[:, 0]))
    ends, beside = ends[order].astype(int), beside[order]
    pairs = np.flatnonzero((ends[1:] == ends[:-1]).all(axis=1) & (beside[1:] != beside[:-1]))
    sides = np.column_stack([beside[pairs], beside[pairs + 1]])
    normals = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    return Hull(vertices, normals, faces[first, 0], ends[pairs], sides)


def _fan(polygons: list[list[int]]) -> np.ndarray:
    return np.array([[p[0], p[i], p[i + 1]] for p in polygons for i in range(1, len(p) - 1)])


def _cube() -> Hull:
    corners = np.array([[x, y, z] for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
    quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]]
    return _solid(corners, _fan(quads))


def _prism() -> Hull:
    angles = np.arange(SIDES) * math.tau / SIDES
    rim = np.column_stack([np.cos(angles), np.sin(angles), np.full(SIDES, 0.5)])
    walls = [[i, (i + 1) % SIDES, (i + 1) % SIDES + SIDES, i + SIDES] for i in range(SIDES)]
    ends = [[*range(SIDES - 1, -1, -1)], [*range(SIDES, 2 * SIDES)]]
    return _solid(np.vstack([rim * (1, 1, -1), rim]), _fan(walls + ends))


def _ball() -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of a ball of radius 1."""
    rings = SIDES // 2 - 1
    tilts = np.repeat(np.arange(1, rings + 1) * math.pi / (rings + 1), SIDES)
    turns = np.tile(np.arange(SIDES) * math.tau / SIDES, rings)
    middle = np.column_stack([np.sin(tilts) * np.cos(turns), np.sin(tilts) * np.sin(turns), np.cos(tilts)])
    top, bottom = rings * SIDES, rings * SIDES + 1
    polygons = []
    for i in range(SIDES):
        after = (i + 1) % SIDES
        polygons += [[top, i, after], [bottom, bottom - 1 - SIDES + after, bottom - 1 - SIDES + i]]
        for ring in range(0, (rings - 1) * SIDES, SIDES):
            polygons.append([ring + i, ring + SIDES + i, ring + SIDES + after, ring + after])
    return np.vstack([middle, [[0, 0, 1], [0, 0, -1]]]), _fan(polygons)


def _segment() -> Hull:
    """A line segment along z: a prism of three sides whose cross-section is a point."""
    angles = np.arange(3) * math.tau / 3
    normals = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(3)])
    ends = np.array([[0, 0, -0.5], [0, 0, 0.5]])
    return Hull(ends, normals, np.zeros(3, dtype=int), np.array([[0, 1]] * 3), np.array([[0, 1], [1, 2], [2, 0]]))


_CUBE, _PRISM, _SEGMENT, _BALL = _cube(), _prism(), _segment(), _ball()


def _nearest(simplex: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The point of a simplex (maximum 4 points) nearest to the origin, and the corners that span it."""
    best, corners = simplex[0], simplex[:1]
    for count in range(1, len(simplex) + 1):
        for chosen in combinations(range(len(simplex)), count):
            points = simplex[list(chosen)]
            sides = points[1:] - points[0]
            weights = np.linalg.lstsq(sides.T, -points[0], rcond=None)[0]
            if (weights < 0).any() or weights.sum() > 1:
                continue
            point = points[0] + weights @ sides
            if point @ point < best @ best - SMALL**2:
                best, corners = point, points
    return best, corners


def _depth(a: Hull, b: Hull) -> float:
    """The shortest separating move along a face normal or across two edges, m; negative if the bodies are apart."""
    moves = np.concatenate([_out_of(a, b), _out_of(b, a)])
    # Two points have no normals: any direction will do.
    least = float(moves.min()) if len(moves) else a.radius + b.radius
    return min([least, *_across(a, b)]) if least > 0 else least


def _out_of(a: Hull, b: Hull) -> np.ndarray:
    """How far `b` must be moved along each of a's normals."""
    if not len(a.normals):
        return np.empty(0)
    heights: np.ndarray = np.einsum("ij,ij->i", a.normals, a.vertices[a.on]) + a.radius
    moves: np.ndarray = heights - b.span(a.normals)[0]
    return moves


def _across(a: Hull, b: Hull) -> np.ndarray:
    """The move along each direction perpendicular to an edge of both bodies, for pairs of edges that may give the shortest."""
    first, second = _crossing(a, b)
    from_a, from_b = a.vertices[a.edges[first]], b.vertices[b.edges[second]]
    axes = np.cross(from_a[:, 1] - from_a[:, 0], from_b[:, 1] - from_b[:, 0])
    lengths = np.linalg.norm(axes, axis=1)
    apart = lengths > SMALL
    axes = axes[apart] / lengths[apart, None]
    outward = np.einsum("ij,ij->i", axes, a.normals[a.sides[first[apart]]].sum(axis=1))
    between = from_a[apart, 0] - from_b[apart, 0]
    along: np.ndarray = np.einsum("ij,ij->i", axes, between) * np.where(outward < 0, -1, 1)
    return along + a.radius + b.radius


def _crossing(a: Hull, b: Hull) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of edges that form a face of the Minkowski difference: the arcs of their normals cross on the unit sphere."""
    start, end = a.normals[a.sides[:, 0]], a.normals[a.sides[:, 1]]
    other_start, other_end = -b.normals[b.sides[:, 0]], -b.normals[b.sides[:, 1]]
    across, other_across = np.cross(end, start), np.cross(other_end, other_start)
    cba, dba = across @ other_start.T, across @ other_end.T
    adc, bdc = start @ other_across.T, end @ other_across.T
    first, second = np.nonzero((cba * dba < 0) & (adc * bdc < 0) & (cba * bdc > 0))
    return first, second
