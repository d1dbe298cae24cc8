"""Triangulates shapes, from sizes and poses (m) to arrays, and paints models with them.

At a sharp edge each face has its own copy of a corner, since the browser averages the shading over
shared corners.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import meshcat.geometry as meshcat
import numpy as np

from ddenv.scene import colors
from ddenv.scene.colors import Color
from ddenv.text import Data
from ddenv.world.model import (
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Mesh,
    Model,
    Plane,
    Shape,
    Sphere,
    Terrain,
    Visual,
)
from ddenv.world.pose import Point, Pose, Vector
from ddenv.world.terrain import surface

SIDES = 24  # of the polygon that stands for a circle
# Minimum distance between points of a drawn trajectory, as part of its radius: a robot that stands
# still leaves one point.
TUBE_STEP = 1.6
# A corner of a mesh looks smooth if its faces deviate by less than this from their mean normal,
# rad.
SMOOTH = math.radians(30.0)


@dataclass(frozen=True)
class Surface:
    """`vertices` (N, 3) in m; `faces` (M, 3) are vertex indices, counterclockwise seen from
    outside.

    A painted one has the colours of its vertices, `tints` (N, 3), and one transparency.
    """

    vertices: np.ndarray
    faces: np.ndarray
    tints: np.ndarray | None = None
    alpha: float = 1.0

    def at(self, pose: Pose) -> Surface:
        """This surface, given in the frame `pose`, seen from that frame's parent."""
        return replace(self, vertices=self.vertices @ pose.rotation().T + pose.position)

    def painted(self, color: Sequence[float]) -> Surface:
        *tint, alpha = color
        return replace(self, tints=np.tile(tint, (len(self.vertices), 1)), alpha=alpha)

    @property
    def triangles(self) -> np.ndarray:
        """Corners of every face, shape (M, 3, 3)."""
        corners: np.ndarray = self.vertices[self.faces]
        return corners

    def thing(self) -> meshcat.Mesh:
        """What a browser draws of a painted surface."""
        geometry = meshcat.TriangularMeshGeometry(self.vertices, self.faces, color=self.tints)
        # Only the outside is drawn: two-sided faces would cast shadows on themselves.
        return meshcat.Mesh(
            geometry, meshcat.MeshLambertMaterial(vertexColors=True, side=0, opacity=self.alpha)
        )


EMPTY = Surface(np.zeros((0, 3)), np.zeros((0, 3), dtype=np.uint32))


def merge(surfaces: Sequence[Surface]) -> Surface:
    """One surface with the faces of all `surfaces`, which are all painted, in one transparency, or
    not.
    """
    if not surfaces:
        return EMPTY
    starts = np.cumsum([0, *(len(one.vertices) for one in surfaces[:-1])])
    faces = [one.faces + start for one, start in zip(surfaces, starts, strict=True)]
    tints = [one.tints for one in surfaces if one.tints is not None]
    return Surface(
        np.concatenate([one.vertices for one in surfaces]),
        np.concatenate(faces).astype(np.uint32),
        np.concatenate(tints) if tints else None,
        surfaces[0].alpha,
    )


# Corners of a box around the origin with sides of 1, numbered by their bits x, y, z, and the edges
# that join them.
CORNERS = np.array([(x, y, z) for z in (-0.5, 0.5) for y in (-0.5, 0.5) for x in (-0.5, 0.5)])
EDGES = np.array(
    [(a, a | 1 << axis) for axis in range(3) for a in range(8) if not a >> axis & 1]
).ravel()
_SIDES = ((0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5))
_HALVES = np.array(
    [(4 * side, 4 * side + a, 4 * side + a + 1) for side in range(6) for a in (1, 2)],
    dtype=np.uint32,
)


def box(size: Sequence[float]) -> Surface:
    """A box centred on its frame's origin; `size` along x, y, z."""
    return Surface(CORNERS[np.ravel(_SIDES)] * np.asarray(size, dtype=float), _HALVES)


def revolved(*profiles: Sequence[Point], sides: int = SIDES) -> Surface:
    """The surface of profiles (radius, z), each from top to bottom, turned around z; between
    profiles the edge is sharp.
    """
    angles = np.arange(sides) * 2 * math.pi / sides
    parts = []
    for profile in profiles:
        radii, heights = np.array(profile, dtype=float).T[:, :, None]
        points = np.stack(
            [radii * np.cos(angles), radii * np.sin(angles), heights + 0 * angles], axis=-1
        )
        parts.append(Surface(points.reshape(-1, 3), _sheet(len(profile), sides)))
    return merge(parts)


def frustum(bottom: float, top: float, length: float) -> Surface:
    """A truncated cone along z, centred on its frame's origin, with radii `bottom` and `top`."""
    low = (bottom, -length / 2)
    high = (top, length / 2)
    return revolved([(0.0, length / 2), high], [high, low], [low, (0.0, -length / 2)])


def sphere(radius: float) -> Surface:
    """A sphere centred on its frame's origin."""
    return revolved(_arc(radius, 0.0, math.pi, SIDES // 2))


def capsule(radius: float, length: float) -> Surface:
    """A cylinder of `length` along z, centred on its frame's origin, with a hemisphere on each
    end.
    """
    top = _arc(radius, 0.0, math.pi / 2, SIDES // 4)
    bottom = _arc(radius, math.pi / 2, math.pi, SIDES // 4)
    return revolved(
        [*((r, z + length / 2) for r, z in top), *((r, z - length / 2) for r, z in bottom)]
    )


def ring(radius: float, thickness: float) -> Surface:
    """A torus in the plane z = 0 around its frame's origin."""
    circle = _arc(thickness / 2, 0.0, 2 * math.pi, 8)
    return revolved([(radius + r, z) for r, z in circle], sides=2 * SIDES)


def _arc(radius: float, begin: float, end: float, pieces: int) -> list[Point]:
    """A part of a circle as a profile; angles from z on, rad."""
    return [
        (radius * math.sin(at), radius * math.cos(at))
        for at in np.linspace(begin, end, pieces + 1).tolist()
    ]


def creased(mesh: Mesh) -> Surface:
    """The surface of a mesh, smooth where it bends little, with sharp edges elsewhere."""
    corners = mesh.vertices[mesh.faces]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    flat = mesh.faces.ravel()
    count = len(mesh.vertices)
    weights = np.repeat(normals, 3, axis=0)
    common = np.column_stack([np.bincount(flat, weights[:, axis], count) for axis in range(3)])[
        mesh.faces
    ]
    along = np.einsum("fi,fci->fc", normals, common)
    lengths = np.linalg.norm(normals, axis=1)[:, None] * np.linalg.norm(common, axis=2)
    sharp = along < math.cos(SMOOTH) * lengths
    faces = mesh.faces.astype(np.int64)
    faces[sharp] = count + np.arange(sharp.sum())
    used = np.zeros(count + int(sharp.sum()), dtype=bool)
    used[faces] = True
    number = np.cumsum(used) - 1
    return Surface(
        np.concatenate([mesh.vertices, corners[sharp]])[used], number[faces].astype(np.uint32)
    )


def tube(points: np.ndarray, radius: float) -> Surface:
    """A tube along the path `points` (N, 3), thinned by `TUBE_STEP`; empty for a path without
    length.
    """
    taken = list(points[:1])
    for point in points[1:]:
        if np.linalg.norm(point - taken[-1]) >= TUBE_STEP * radius:
            taken.append(point)
    if len(taken) < 2:
        return EMPTY
    path = np.array(taken)
    ahead = np.gradient(path, axis=0)
    ahead /= np.maximum(np.linalg.norm(ahead, axis=1, keepdims=True), 1e-12)
    # Sections are spanned from z, or from x where the path is vertical.
    upright = np.abs(ahead[:, 2:]) > 0.99
    aside = np.cross(np.where(upright, [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]), ahead)
    aside /= np.maximum(np.linalg.norm(aside, axis=1, keepdims=True), 1e-12)
    over = np.cross(ahead, aside)
    angles = -np.arange(8) * math.pi / 4
    section = (
        np.cos(angles)[None, :, None] * aside[:, None]
        + np.sin(angles)[None, :, None] * over[:, None]
    )
    return Surface((path[:, None] + radius * section).reshape(-1, 3), _sheet(len(path), 8))


def of_shape(shape: Shape) -> Surface:
    """The surface of a shape in its own frame; empty for a plane, since the ground is drawn
    separately.
    """
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
            ball = sphere(1.0)
            return replace(ball, vertices=ball.vertices * radii)
        case Mesh():
            return creased(shape)
        case Terrain():
            return creased(surface(shape))
    return EMPTY


def height_at(surface: Surface, x: float, y: float) -> float | None:
    """The height of the highest face at (x, y), m; None if there is none."""

    def cross(a: np.ndarray, b: np.ndarray) -> np.ndarray:
        product: np.ndarray = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
        return product

    origin, second, third = np.moveaxis(surface.triangles, 1, 0)
    first = second - origin
    second = third - origin
    place = (x, y) - origin[:, :2]
    area = cross(first, second)
    # A face on edge has no area.
    area[np.abs(area) < 1e-12] = np.nan
    u = cross(place, second) / area
    v = cross(first, place) / area
    inside = (u >= -1e-9) & (v >= -1e-9) & (u + v <= 1 + 1e-9)
    heights = (origin[:, 2] + u * first[:, 2] + v * second[:, 2])[inside]
    if len(heights):
        return float(heights.max())
    return None


def hides(surface: Surface, place: np.ndarray, way: Vector) -> bool:
    """Whether a face is met from `place` (3,) m on the `way` (3,), which leads upwards."""
    x, y, z = way
    vertices = surface.vertices - place
    # All faces are moved so that the way is upright.
    vertices -= vertices[:, 2:] * (x / z, y / z, 0.0)
    highest = height_at(replace(surface, vertices=vertices), 0.0, 0.0)
    return (highest or 0.0) > 0.0


def _sheet(rows: int, columns: int) -> np.ndarray:
    """Faces between neighbouring rows of points, where each row is a closed loop."""
    row, column = np.meshgrid(np.arange(rows - 1), np.arange(columns), indexing="ij")
    here = row * columns + column
    right = row * columns + (column + 1) % columns
    below = here + columns
    diagonal = right + columns
    faces = np.stack(
        [np.stack([here, below, diagonal], axis=-1), np.stack([here, diagonal, right], axis=-1)]
    )
    return faces.reshape(-1, 3).astype(np.uint32)


def paint(model: Model) -> list[Surface]:
    """All visuals of a model, in the frame of its poses, by transparency. A link without visuals
    shows its collisions.
    """
    groups: dict[float, list[Surface]] = {}
    default = colors.STILL if model.static else colors.MOVABLE
    shown: list[Visual | Collision] = [
        item for link in model.links for item in link.visuals or link.collisions
    ]
    for item in shown:
        color = (item.color if isinstance(item, Visual) else None) or default
        if not isinstance(item.shape, Plane):
            surface = of_shape(item.shape).at(item.pose).painted(color)
            groups.setdefault(surface.alpha, []).append(surface)
    return [merge(parts) for alpha, parts in groups.items() if alpha > 0]


def plain(shape: Surface, color: Color, *, glow: float = 0.0, offset: int = 0) -> meshcat.Mesh:
    """An object of one colour. `glow` 0..1 is its own light; with `offset` above 0, others in the
    same plane are drawn over it.
    """
    options: Data = {}
    if glow:
        red, green, blue, _ = color
        options["emissive"] = colors.hexadecimal((glow * red, glow * green, glow * blue, 1.0))
    if offset:
        options |= {
            "polygonOffset": True,
            "polygonOffsetFactor": offset,
            "polygonOffsetUnits": offset,
        }
    material = meshcat.MeshLambertMaterial(
        color=colors.hexadecimal(color), opacity=color[3], side=0, **options
    )
    return meshcat.Mesh(meshcat.TriangularMeshGeometry(shape.vertices, shape.faces), material)


def lines(ends: np.ndarray, color: Color) -> meshcat.LineSegments:
    """Line segments between pairs of `ends` (2 N, 3)."""
    material = meshcat.LineBasicMaterial(color=colors.hexadecimal(color), opacity=color[3])
    return meshcat.LineSegments(
        meshcat.PointsGeometry(np.asarray(ends, dtype=np.float32).T), material
    )


def outline(model: Model, shape: Surface) -> np.ndarray:
    """Ends (24, 3) of the 12 edges of the box around `shape` in the axes of the model; world
    frame.
    """
    own = shape.at(model.pose.inverse()).vertices
    low = own.min(axis=0)
    high = own.max(axis=0)
    return Surface(edges_of(low, high), shape.faces).at(model.pose).vertices


def edges_of(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Ends (24, 3) of the edges of a box."""
    ends: np.ndarray = (low + high) / 2 + CORNERS[EDGES] * (high - low)
    return ends
