"""What stands for a convex mesh: a box or a cylinder if it is one, else pieces that are not long.

Drake's general solver is wrong at the edges of meshes, and the more so the longer the mesh is
(`contact_shapes.py`). Against one of 8 m a wheel is stopped by a lip of 1 mm; against pieces of at
most 4 m the highest kerb that a robot climbs is right within 10 %.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import trimesh

from ddenv.arrays import Floats
from ddenv.world.files.boxes import box_of
from ddenv.world.hull import convex_hull
from ddenv.world.model import Cylinder, Mesh, Shape
from ddenv.world.pose import HERE, Pose, pointing, vector

LONGEST = 2.0  # of a piece along any axis of its mesh, m
MOST_PIECES = 512  # of one mesh: of a larger one the pieces are longer
# A prism with at least this many sides is a cylinder if its corners lie on a circle within this
# share of the radius.
SIDES = 12
ROUND = 0.01


@cache
def pieces(mesh: Mesh) -> list[tuple[Shape, Pose]]:
    """The shapes that stand for a convex mesh, in its frame."""
    known = box_of(mesh) or _as_cylinder(mesh)
    if known is not None:
        return [known]
    return [(piece, HERE) for piece in _cut(mesh)]


def _solid(mesh: Mesh) -> trimesh.Trimesh:
    return trimesh.Trimesh(mesh.vertices, mesh.faces, process=False)


def _as_cylinder(mesh: Mesh) -> tuple[Shape, Pose] | None:
    """The cylinder that `mesh` stands for if it is a regular prism of many sides; None if it is
    another shape.
    """
    if len(mesh.vertices) < 2 * SIDES:
        return None
    middle = mesh.vertices.mean(axis=0)
    for axis in _solid(mesh).facets_normal:
        turn = pointing(vector(axis))
        x, y, z = ((mesh.vertices - middle) @ turn.rotation()).T
        distances = np.hypot(x, y)
        radius = float(distances.max())
        angles = np.sort(np.arctan2(y, x))
        widest = float(np.diff(angles, append=angles[0] + math.tau).max())
        at_ends = np.abs(z).min() > (1 - ROUND) * np.abs(z).max()
        if at_ends and distances.min() > (1 - ROUND) * radius and widest < 1.1 * math.tau / SIDES:
            # Between its corners and the middles of its sides.
            between = radius * (1 + math.cos(widest / 2)) / 2
            return Cylinder(between, float(np.ptp(z))), Pose(vector(middle), turn.quaternion)
    return None


def _cut(mesh: Mesh) -> list[Mesh]:
    """The pieces of a convex mesh, cut along the planes of a grid; the mesh itself if it is
    short.
    """
    low = mesh.vertices.min(axis=0)
    high = mesh.vertices.max(axis=0)
    longest = LONGEST
    while math.prod(counts := np.ceil((high - low) / longest).astype(int).tolist()) > MOST_PIECES:
        longest *= 1.25
    parts = [(mesh.vertices, mesh.faces)]
    for axis, count in enumerate(counts):
        for place in np.linspace(low, high, count + 1)[1:-1]:
            parts = [half for part in parts for half in _halves(*part, np.eye(3)[axis], place)]
    if len(parts) == 1:
        return [mesh]
    return [Mesh(f"{mesh.origin} {number}", *part) for number, part in enumerate(parts)]


def _halves(
    vertices: Floats, faces: Floats, normal: Floats, place: Floats
) -> list[tuple[Floats, Floats]]:
    """The convex hull of `vertices`, cut by the plane through `place` (3,) m; one part if the plane
    misses it.
    """
    sides = (
        trimesh.intersections.slice_faces_plane(vertices, faces, side * normal, place)[0]
        for side in (-1, 1)
    )
    return [convex_hull(points) for points in sides if len(points)]
