"""Triangulates shapes, from sizes and poses (m) to arrays, and paints models with them.

At a sharp edge each face has its own copy of a corner, since the browser averages the shading over shared corners.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import meshcat.geometry as meshcat
import numpy as np

from ddenv.scene import colors
from ddenv.scene.colors import Color
from ddenv.world.model import Box, Capsule, Collision, Cylinder, Ellipsoid, Mesh, Model, Plane, Shape, Sphere, Visual
from ddenv.world.pose import Pose

SIDES = 24  # of the polygon that stands for a circle
# Minimum distance between points of a drawn trajectory, m: a robot that stands still leaves one point.
TUBE_STEP = 0.04
# A corner of a mesh looks smooth if its faces deviate by less than this from their mean normal, rad.
SMOOTH = math.radians(30.0)


@dataclass(frozen=True)
class Surface:
    """`vertices` (N, 3) in m; `faces` (M, 3) are vertex indices, counterclockwise seen from outside."""

    vertices: np.ndarray
    faces: np.ndarray

    def at(self, pose: Pose) -> Surface:
        """This surface, given in the frame `pose`, seen from that frame's parent."""
        return Surface(self.vertices @ pose.rotation().T + pose.position, self.faces)

    @property
    def triangles(self) -> np.ndarray:
        """Corners of every face, shape (M, 3, 3)."""
        corners: np.ndarray = self.vertices[self.faces]
        return corners


EMPTY = Surface(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.uint32))


def merge(surfaces: Sequence[Surface]) -> Surface:
    """One surface with the faces of all `surfaces`."""
    if not surfaces:
        return EMPTY
    starts = np.cumsum([0, *(len(one.vertices) for one in surfaces[:-1])])
    faces = [one.faces + start for one, start in zip(surfaces, starts, strict=True)]
    return Surface(np.concatenate([one.vertices for one in surfaces]), np.concatenate(faces).astype(np.uint32))


def _unit_box() -> Surface:
    quads = []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            u, v = np.roll(np.eye(3), axis + 1, axis=1)[:2] if sign > 0 else np.roll(np.eye(3), axis + 1, axis=1)[1::-1]
            normal = np.eye(3)[axis] * sign
            quads.append([0.5 * (normal + a * u + b * v) for a, b in ((-1, -1), (1, -1), (1, 1), (-1, 1))])
    faces = [[4 * quad + a, 4 * quad + b, 4 * quad + c] for quad in range(6) for a, b, c in ((0, 1, 2), (0, 2, 3))]
    return Surface(np.array(quads).reshape(-1, 3), np.array(faces, dtype=np.uint32))


_UNIT_BOX = _unit_box()


def box(size: Sequence[float]) -> Surface:
    """A box centred on its frame's origin; `size` along x, y, z."""
    return Surface(_UNIT_BOX.vertices * np.asarray(size, dtype=float), _UNIT_BOX.faces)


def frustum(bottom: float, top: float, length: float) -> Surface:
    """A truncated cone along z, centred on its frame's origin, with radii `bottom` and `top`."""
    angles = np.arange(SIDES) * 2 * math.pi / SIDES
    circle = np.column_stack([np.cos(angles), np.sin(angles)])
    low = np.column_stack([circle * bottom, np.full(SIDES, -length / 2)])
    high = np.column_stack([circle * top, np.full(SIDES, length / 2)])
    here, after = np.arange(SIDES), np.roll(np.arange(SIDES), -1)
    wall = np.concatenate(
        [np.column_stack([here, after, after + SIDES]), np.column_stack([here, after + SIDES, here + SIDES])]
    )
    fan = np.column_stack([np.zeros(SIDES - 2, dtype=int), np.arange(1, SIDES - 1), np.arange(2, SIDES)])
    parts = [Surface(np.concatenate([low, high]), wall), Surface(low, fan[:, ::-1]), Surface(high, fan)]
    return merge(parts)


def sphere(radius: float, sides: int = SIDES) -> Surface:
    """A sphere centred on its frame's origin."""
    rings = sides // 2
    theta, phi = np.meshgrid(np.linspace(0, math.pi, rings + 1), np.arange(sides) * 2 * math.pi / sides, indexing="ij")
    points = radius * np.stack([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), np.cos(theta)], axis=-1)
    return Surface(points.reshape(-1, 3), _sheet(rings + 1, sides))


def ellipsoid(radii: Sequence[float]) -> Surface:
    """An ellipsoid centred on its frame's origin; `radii` along x, y, z."""
    ball = sphere(1.0)
    return Surface(ball.vertices * np.asarray(radii, dtype=float), ball.faces)


def capsule(radius: float, length: float) -> Surface:
    """A cylinder of `length` along z, centred on its frame's origin, with a hemisphere on each end."""
    ball = sphere(radius)
    rings = ball.vertices.reshape(-1, SIDES, 3)
    middle = len(rings) // 2
    # The equator appears twice, once at each end of the cylinder.
    end = np.array([0.0, 0.0, length / 2])
    halves = np.concatenate([rings[: middle + 1] + end, rings[middle:] - end])
    return Surface(halves.reshape(-1, 3), _sheet(len(halves), SIDES))


def creased(mesh: Mesh) -> Surface:
    """The surface of a mesh, smooth where it bends little, with sharp edges elsewhere."""
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat, count = mesh.faces.ravel(), len(mesh.vertices)
    weights = np.repeat(normals, 3, axis=0)
    common = np.column_stack([np.bincount(flat, weights[:, axis], count) for axis in range(3)])[mesh.faces]
    along = np.einsum("fi,fci->fc", normals, common)
    lengths = np.linalg.norm(normals, axis=1)[:, None] * np.linalg.norm(common, axis=2)
    sharp = along < math.cos(SMOOTH) * lengths
    faces = mesh.faces.astype(np.int64)
    faces[sharp] = count + np.arange(sharp.sum())
    used = np.zeros(count + int(sharp.sum()), dtype=bool)
    used[faces] = True
    number = np.cumsum(used) - 1
    return Surface(np.concatenate([mesh.vertices, corners[sharp]])[used], number[faces].astype(np.uint32))


def ring(radius: float, thickness: float) -> Surface:
    """A torus in the plane z = 0 around its frame's origin."""
    sides = 2 * SIDES
    around, across = np.meshgrid(np.arange(sides + 1) * 2 * math.pi / sides, np.arange(8) * math.pi / 4, indexing="ij")
    distance = radius + thickness / 2 * np.cos(across)
    height = thickness / 2 * np.sin(across)
    points = np.stack([distance * np.cos(around), distance * np.sin(around), height], axis=-1)
    return Surface(points.reshape(-1, 3), _sheet(sides + 1, 8))


def tube(points: np.ndarray, radius: float) -> Surface:
    """A tube along the path `points` (N, 3), thinned to one point every `TUBE_STEP`; empty for a path without length."""
    path = thinned(points, TUBE_STEP)
    if len(path) < 2:
        return EMPTY
    ahead = np.gradient(path, axis=0)
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-12)
    # Sections are spanned from z, or from x where the path is vertical.
    upright = np.abs(ahead[:, 2:]) > 0.99
    aside = np.cross(np.where(upright, [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]), ahead)
    aside /= np.maximum(np.linalg.norm(aside, axis=1, keepdims=True), 1e-12)
    over = np.cross(ahead, aside)
    angles = -np.arange(8) * math.pi / 4
    section = np.cos(angles)[None, :, None] * aside[:, None] + np.sin(angles)[None, :, None] * over[:, None]
    return Surface((path[:, None] + radius * section).reshape(-1, 3), _sheet(len(path), 8))


def thinned(points: np.ndarray, step: float) -> np.ndarray:
    """The first of `points` (N, 3), and each one that is at least `step` from the last one taken."""
    taken = list(points[:1])
    for point in points[1:]:
        if np.linalg.norm(point - taken[-1]) >= step:
            taken.append(point)
    return np.array(taken).reshape(-1, 3)


def of_shape(shape: Shape) -> Surface:
    """The surface of a shape in its own frame; empty for a plane, since the ground is drawn separately."""
    match shape:
        case Box(size):
            return box(size)
        case Cylinder(radius, length):
            return frustum(radius, radius, length)
        case Sphere(radius):
            return sphere(radius)
        case Capsule(radius, length):
            return capsule(radius, length)
        case Ellipsoid(radii):
            return ellipsoid(radii)
        case Mesh():
            return creased(shape)
    return EMPTY


def height_at(surface: Surface, x: float, y: float) -> float | None:
    """The height of the highest face at (x, y), m; None if there is none."""
    corners = surface.triangles
    if not len(corners):
        return None
    low, high = corners[:, :, :2].min(axis=1), corners[:, :, :2].max(axis=1)
    near = ((low <= (x, y)) & (high >= (x, y))).all(axis=1)
    origin = corners[near, 0]
    first, second = corners[near, 1] - origin, corners[near, 2] - origin
    area = first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
    flat = np.abs(area) > 1e-12
    origin, first, second, area = origin[flat], first[flat], second[flat], area[flat]
    px, py = x - origin[:, 0], y - origin[:, 1]
    u, v = (px * second[:, 1] - py * second[:, 0]) / area, (py * first[:, 0] - px * first[:, 1]) / area
    inside = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9)
    heights = (origin[:, 2] + u * first[:, 2] + v * second[:, 2])[inside]
    return float(heights.max()) if len(heights) else None


def _sheet(rows: int, columns: int) -> np.ndarray:
    """Faces between neighbouring rows of points, where each row is a closed loop."""
    row, column = np.meshgrid(np.arange(rows - 1), np.arange(columns), indexing="ij")
    here, right = row * columns + column, row * columns + (column + 1) % columns
    below, diagonal = here + columns, right + columns
    faces = np.stack([np.stack([here, below, diagonal], axis=-1), np.stack([here, diagonal, right], axis=-1)])
    return faces.reshape(-1, 3).astype(np.uint32)


# Corners of a box, numbered by bits, that its twelve edges join.
_PAIRS = np.array([(a, a | 1 << axis) for axis in range(3) for a in range(8) if not a >> axis & 1]).ravel()


@dataclass(frozen=True)
class Painted:
    """A surface of one transparency; `tints` (N, 3) are the colours of its vertices."""

    surface: Surface
    tints: np.ndarray
    alpha: float

    def thing(self) -> meshcat.Mesh:
        geometry = meshcat.TriangularMeshGeometry(self.surface.vertices, self.surface.faces, color=self.tints)
        # Only the outside is drawn: two-sided faces would cast shadows on themselves.
        return meshcat.Mesh(geometry, meshcat.MeshLambertMaterial(vertexColors=True, side=0, opacity=self.alpha))


def paint(model: Model) -> list[Painted]:
    """All visuals of a model, in the frame of its poses. A link without visuals shows its collisions."""
    groups: dict[float, list[Painted]] = {}
    default = colors.default_color(model)
    shown: list[Visual | Collision] = [item for link in model.links for item in link.visuals or link.collisions]
    vary = len(shown) > 20
    for number, item in enumerate(shown):
        if isinstance(item.shape, Plane):
            continue
        color = (item.color if isinstance(item, Visual) else None) or default
        *tint, alpha = colors.varied(color, number) if vary else color
        surface = of_shape(item.shape).at(item.pose)
        groups.setdefault(alpha, []).append(Painted(surface, np.tile(tint, (len(surface.vertices), 1)), alpha))
    return [joined(parts) for alpha, parts in groups.items() if alpha > 0]


def joined(parts: Sequence[Painted]) -> Painted:
    """All `parts`, at least one, which have one transparency."""
    surface = merge([part.surface for part in parts])
    return Painted(surface, np.concatenate([part.tints for part in parts]), parts[0].alpha)


def plain(shape: Surface, color: Color, *, glow: float = 0.0, offset: int = 0) -> meshcat.Mesh:
    """An object of one colour. `glow` 0..1 is its own light; with `offset` above 0, others in the same plane are drawn over it."""
    options: dict[str, Any] = {}
    if glow:
        red, green, blue, _ = color
        options["emissive"] = colors.hexadecimal((glow * red, glow * green, glow * blue, 1.0))
    if offset:
        options |= {"polygonOffset": True, "polygonOffsetFactor": offset, "polygonOffsetUnits": offset}
    material = meshcat.MeshLambertMaterial(color=colors.hexadecimal(color), opacity=color[3], side=0, **options)
    return meshcat.Mesh(meshcat.TriangularMeshGeometry(shape.vertices, shape.faces), material)


def lines(ends: np.ndarray, color: Color) -> meshcat.LineSegments:
    """Line segments between pairs of `ends` (2 N, 3)."""
    material = meshcat.LineBasicMaterial(color=colors.hexadecimal(color), opacity=color[3])
    return meshcat.LineSegments(meshcat.PointsGeometry(np.asarray(ends, dtype=np.float32).T), material)


def outline(model: Model, shape: Surface) -> np.ndarray:
    """Ends (24, 3) of the 12 edges of the box around `shape` in the axes of the model; world frame."""
    own = shape.at(model.pose.inverse()).vertices
    low, high = own.min(axis=0), own.max(axis=0)
    return Surface(edges_of(low, high), shape.faces).at(model.pose).vertices


def edges_of(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Ends (24, 3) of the edges of a box."""
    corners = np.array([[(high if bit >> axis & 1 else low)[axis] for axis in range(3)] for bit in range(8)])
    ends: np.ndarray = corners[_PAIRS]
    return ends
