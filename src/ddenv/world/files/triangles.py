"""Named pieces of a mesh file, as they come out of every format's reader."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

# A few lines of a file can place one geometry a million times.
MOST_FACES = 20_000_000
MOST_PARTS = 100_000


@dataclass(frozen=True, slots=True)
class Part:
    """Triangles of one place in a file: `vertices` (N, 3) in m, `faces` (M, 3) numbers of them, counterclockwise from outside.

    `names` are what a `<submesh>` may call it, the one that Gazebo goes by first.
    """

    names: tuple[str, ...]
    vertices: np.ndarray
    faces: np.ndarray


def parts_of(meshes: Iterable[tuple[tuple[str, ...], object]]) -> list[Part]:
    """Parts from names and what trimesh loaded, which may be points or empty too. Raises ValueError."""
    return [_part(names, mesh) for names, mesh in meshes if len(getattr(mesh, "faces", ()))]


def _part(names: tuple[str, ...], mesh) -> Part:
    """Only the vertices that its faces use: many parts may share one long list."""
    vertices = mesh.vertices.view(np.ndarray)
    used, places = np.unique(mesh.faces, return_inverse=True)
    # trimesh lets such faces pass, and numpy counts negative numbers from the end.
    if not 0 <= used[0] <= used[-1] < len(vertices):
        raise ValueError("a face names a vertex that is not there")
    if vertices.shape[1] != 3:
        raise ValueError("a vertex has fewer than three numbers")
    return Part(names, vertices[used], places.reshape(-1, 3))


def chosen(parts: Sequence[Part], name: str) -> list[Part]:
    """The parts called `name`, or all for an empty name. Raises ValueError with the names that exist."""
    if not name:
        return list(parts)
    for rank in range(max((len(part.names) for part in parts), default=0)):
        if found := [part for part in parts if part.names[rank : rank + 1] == (name,)]:
            return found
    known = list(dict.fromkeys(part.names[0] for part in parts if part.names and part.names[0]))
    if not known:
        raise ValueError(f"has no submesh '{name[:60]}': its parts have no names")
    more = f" and {len(known) - 5} more" if len(known) > 5 else ""
    listed = ", ".join(f"'{each[:60]}'" for each in known[:5])
    raise ValueError(f"has no submesh '{name[:60]}'; it has {listed}{more}")


def joined(parts: Sequence[Part]) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of all parts in one. Raises ValueError for none."""
    if not parts:
        raise ValueError("has no triangles")
    from trimesh.util import append_faces

    return append_faces([part.vertices for part in parts], [part.faces for part in parts])
