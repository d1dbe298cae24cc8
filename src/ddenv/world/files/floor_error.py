"""How well the convex pieces of a mesh block what the mesh itself blocks, on the floor at the
height of a robot.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass
from itertools import groupby

import numpy as np
import trimesh
from manifold3d import CrossSection, FillRule, Manifold
from trimesh.intersections import slice_faces_plane

from ddenv.arrays import Floats
from ddenv.text import first_of
from ddenv.world.extent import vertices_of
from ddenv.world.files.pieces import connected_parts, solid_of, union
from ddenv.world.model import UNCUT, Collision, Mesh, Model, Piece, World
from ddenv.world.pose import Pose

# Between these heights above z = 0 most robots touch what is there, m.
LOW = 0.03
HIGH = 0.43
# A larger share of the floor that a mesh spans is worth a warning, if it is also more than this
# many m^2.
LARGE = 0.02
LARGE_AREA = 0.01
MOST_NAMES = 5
UP = (0.0, 0.0, 1.0)
DOWN = (0.0, 0.0, -1.0)


@dataclass(frozen=True, kw_only=True)
class FloorError:
    """Of a mesh in so many `pieces`: the `floor` that it spans, m^2, and the shares of it wrongly
    `blocked` and `free`.
    """

    model: str
    pieces: int
    floor: float
    blocked: float
    free: float


def floor_errors(models: Iterable[Model]) -> Iterator[FloorError]:
    """The errors of all meshes of `models` that are cut into pieces, and reach the heights of a
    robot.
    """
    for owner, link in ((model, link) for model in models for link in model.links):
        cut = ((one.piece, one) for one in link.collisions if one.piece is not None)
        for (mesh, _), group in groupby(cut, key=lambda pair: (pair[0].mesh, pair[1].name)):
            # Of a finer mesh only the hull is known.
            if mesh.simplified:
                continue
            error = _error(owner.name, list(group))
            if error.floor > 0:
                yield error


def _error(model: str, pieces: list[tuple[Piece, Collision]]) -> FloorError:
    """The error of the mesh that is cut into `pieces`; its floor is 0 if it lies above or below a
    robot.
    """
    piece, first = pieces[0]
    truth = _of_mesh(piece.mesh, first.pose @ piece.pose.inverse())
    solids = (
        Manifold.hull_points(_placed(vertices_of(one.shape, 0)[0], one.pose)) for _, one in pieces
    )
    taken = union(_at_height(solid) for solid in solids)
    floor = (truth + taken).hull().area()
    blocked = max((taken - truth).area(), 0.0)
    free = max((truth - taken).area(), 0.0)
    return FloorError(
        model=model,
        pieces=len(pieces),
        floor=floor,
        blocked=blocked / max(floor, 1e-12),
        free=free / max(floor, 1e-12),
    )


def note_pieces(world: World, among: Collection[str]) -> Iterator[tuple[str, str]]:
    """Which `among` these models block the floor clearly otherwise than their meshes do, or are not
    compared with these.
    """
    wrong = [
        f"{note.model} (its hull: {UNCUT})"
        for note in world.notes
        if UNCUT in note.why and note.model in among
    ]
    there = [model for model in world.models if model.name in among]
    for model in there:
        cut = [one.piece for one in model.collisions if one.piece is not None]
        fine = sum(piece.mesh.simplified for piece in cut)
        if fine:
            wrong.append(f"{model.name} ({fine} pieces: perhaps; its mesh is too fine to compare)")
    for error in floor_errors(there):
        most = max(error.blocked, error.free)
        if most > LARGE and most * error.floor > LARGE_AREA:
            shares = f"{100 * error.blocked:.0f} % too much, {100 * error.free:.0f} % too little"
            wrong.append(f"{error.model} ({error.pieces} pieces: {shares})")
    if wrong:
        yield (
            "pieces",
            f"models whose convex pieces block the floor at {LOW:g} to {HIGH:g} m otherwise than "
            "their mesh: "
            f"{first_of(wrong, MOST_NAMES)}",
        )


def _of_mesh(mesh: Mesh, place: Pose) -> CrossSection:
    """What the mesh blocks, seen from above: its solids, and the triangles of what encloses
    nothing.
    """
    outlines: list[CrossSection] = []
    for part in connected_parts(_placed(mesh.vertices, place), mesh.faces.astype(np.int64)):
        solid = solid_of(part)
        outlines += _triangles(part) if solid is None else [_at_height(solid)]
    return union(outlines)


def _triangles(part: trimesh.Trimesh) -> list[CrossSection]:
    above = slice_faces_plane(part.vertices, part.faces, np.array(UP), np.array([0.0, 0.0, LOW]))
    vertices, faces, _ = slice_faces_plane(
        above[0], above[1], np.array(DOWN), np.array([0.0, 0.0, HIGH])
    )
    return [CrossSection([corners], FillRule.EvenOdd) for corners in vertices[faces][:, :, :2]]


def _at_height(solid: Manifold) -> CrossSection:
    """The part of `solid` that a robot can touch, seen from above."""
    outline: CrossSection = solid.trim_by_plane(UP, LOW).trim_by_plane(DOWN, -HIGH).project()
    return outline


def _placed(vertices: Floats, place: Pose) -> Floats:
    placed: Floats = vertices @ place.rotation().T + place.position
    return placed
