"""What stands for a convex mesh: a box or a cylinder if it is one, else pieces that are not long.

Drake's general solver is wrong at the edges of meshes, and the more so the longer the mesh is (`contact_shapes.py`). Against one of
8 m a wheel is stopped by a lip of 1 mm; against pieces of at most 4 m the highest kerb that a robot climbs is right within 10 %.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from scipy.spatial.transform import Rotation

from ddenv.arrays import Floats
from ddenv.world.files.meshes import convex_hull
from ddenv.world.model import Box, Cylinder, Mesh, Shape
from ddenv.world.pose import Pose, Vector, vector

LONGEST = 2.0  # of a piece along any axis of its mesh, m
MOST_PIECES = 512  # of one mesh: of a larger one the pieces are longer
# Faces count as parallel or perpendicular within this (the sine of the angle between them), and sliver faces do not count.
STRAIGHT = 2e-3
SLIVER = 1e-6
# A prism with at least this many sides counts as a cylinder if its corners lie on a circle within this share of the radius.
SIDES = 12
ROUND = 0.01


@cache
def pieces(mesh: Mesh) -> list[tuple[Shape, Pose]]:
    """The shapes that stand for a convex mesh, in its frame."""
    normals = _face_normals(mesh)
    known = _as_box(mesh, normals) or _as_cylinder(mesh, normals)
    if known is not None:
        return [known]
    return [(piece, Pose()) for piece in _cut(mesh)]


def _face_normals(mesh: Mesh) -> Floats:
    """The normals (N, 3) of the faces of a mesh, each direction once."""
    corners = mesh.vertices[mesh.faces]
    crosses = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    areas = np.linalg.norm(crosses, axis=1)
    large = areas > SLIVER * areas.sum()
    distinct: list[Floats] = []
    for normal in crosses[large] / areas[large, None]:
        if all(np.linalg.norm(normal - other) > STRAIGHT for other in distinct):
            distinct.append(normal)
    return np.array(distinct)


def _as_box(mesh: Mesh, normals: Floats) -> tuple[Shape, Pose] | None:
    """The box that `mesh` is; None if it is another shape."""
    if len(normals) != 6:
        return None
    first = normals[0]
    across = normals[np.abs(normals @ first) < STRAIGHT]
    if len(across) != 4:
        return None
    second = across[0]
    axes = np.column_stack([first, second, np.cross(first, second)])
    if (np.abs(normals @ axes).max(axis=1) < 1 - STRAIGHT**2).any():
        return None
    size, pose = _extent(mesh, axes)
    return Box(size), pose


def _extent(mesh: Mesh, axes: Floats) -> tuple[Vector, Pose]:
    """The size and the pose of the box around `mesh` along `axes`, the columns of a matrix (3, 3)."""
    turn = Rotation.from_matrix(axes)
    points = mesh.vertices @ turn.as_matrix()
    low, high = points.min(axis=0), points.max(axis=0)
    middle = vector(turn.apply((low + high) / 2))
    x, y, z, w = turn.as_quat().tolist()
    return vector(high - low), Pose(middle, (w, x, y, z))


def _as_cylinder(mesh: Mesh, normals: Floats) -> tuple[Shape, Pose] | None:
    """The cylinder that `mesh` stands for if it is a regular prism of many sides; None if it is another shape."""
    for axis in normals:
        along = np.abs(normals @ axis)
        ends = along > 1 - STRAIGHT**2
        sides = along < STRAIGHT
        if ends.sum() != 2 or sides.sum() < SIDES or not (ends | sides).all():
            continue
        first = normals[sides][0]
        size, turned = _extent(mesh, np.column_stack([first, np.cross(axis, first), axis]))
        # The corners lie evenly around the axis, and as many at each end.
        pose = Pose(vector(mesh.vertices.mean(axis=0)), turned.quaternion)
        points = (mesh.vertices - pose.position) @ pose.rotation()
        corners = np.hypot(points[:, 0], points[:, 1])
        radius = float(corners.max())
        flats = (points @ (normals[sides] @ pose.rotation()).T).max(axis=0)
        if corners.min() < (1 - ROUND) * radius or flats.min() < math.cos(1.1 * math.pi / sides.sum()) * radius:
            continue
        # Between its corners and the middles of its sides.
        return Cylinder((radius + float(flats.mean())) / 2, size[2]), pose
    return None


def _cut(mesh: Mesh) -> list[Mesh]:
    """The pieces of a convex mesh, cut along the planes of a grid; the mesh itself if it is short."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    longest = LONGEST
    while math.prod(counts := np.ceil((high - low) / longest).astype(int).tolist()) > MOST_PIECES:
        longest *= 1.25
    parts = [(mesh.vertices, mesh.faces)]
    for axis, count in enumerate(counts):
        planes = np.linspace(low[axis], high[axis], count + 1)[1:-1]
        for place in planes:
            halves = (_halves(*part, axis, float(place)) for part in parts)
            parts = [half for pair in halves for half in pair]
    if len(parts) == 1:
        return [mesh]
    return [Mesh(f"{mesh.origin} {number}", *part) for number, part in enumerate(parts)]


def _halves(vertices: Floats, faces: Floats, axis: int, place: float) -> list[tuple[Floats, Floats]]:
    """The convex hull of `vertices`, cut where the coordinate `axis` is `place` (m); one part if the plane misses it."""
    heights = vertices[:, axis] - place
    if heights.min() >= 0 or heights.max() <= 0:
        return [(vertices, faces)]
    edges = np.unique(np.sort(np.vstack([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]]), axis=1), axis=0)
    start, end = edges[heights[edges[:, 0]] * heights[edges[:, 1]] < 0].T
    share = (heights[start] / (heights[start] - heights[end]))[:, None]
    crossings = vertices[start] + share * (vertices[end] - vertices[start])
    sides = (vertices[heights <= 0], vertices[heights >= 0])
    return [convex_hull(np.vstack([side, crossings])) for side in sides]
