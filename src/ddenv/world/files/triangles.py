"""Named pieces of a mesh file, as they come out of every format's reader."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from io import BytesIO

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


def read_obj(data: bytes) -> list[Part]:
    """One part for each object and group (`o`, `g`) with faces; polygons become fans. Raises ValueError, IndexError."""
    import trimesh

    text, names = _plain(data.decode("utf-8", errors="replace"))
    scene = trimesh.load_scene(BytesIO(text.encode()), "obj", process=False, skip_materials=True, split_objects=True)
    if not names:
        return []
    return parts_of((names[number], scene.geometry[str(number)]) for number in range(len(names)))


def _plain(text: str) -> tuple[str, list[tuple[str, ...]]]:
    """The vertices and faces alone, in objects called 0, 1, ..., and the names of those.

    trimesh misreads without a word: numbers that count back, the number 0, lines that begin with or are parted by other than one
    blank, and corners with and without `/` in one object; and it joins the names of object and group to one.
    """
    vertices: list[str] = []
    objects: dict[tuple[str, ...], list[str]] = {}
    name, group = "", ""
    for line in text.replace("\\\r\n", " ").replace("\\\n", " ").splitlines():
        word, *rest = line.partition("#")[0].split() or [""]
        if word == "v":
            vertices.append("v " + " ".join(rest[:3]))
        elif word == "f" and len(rest) > 2:
            corners = " ".join(str(_counted(corner, len(vertices))) for corner in rest)
            # A file without objects goes by its groups.
            objects.setdefault((name, group) if name else (group,), []).append("f " + corners)
        elif word == "o":
            name, group = " ".join(rest), ""
        elif word == "g":
            group = " ".join(rest)
    faces = [line for number, lines in enumerate(objects.values()) for line in (f"o {number}", *lines)]
    return "\n".join([*vertices, *faces]), list(objects)


def _counted(corner: str, vertices: int) -> int:
    """The number of a corner's vertex, from 1; negative ones count back from the last of the `vertices` before the face."""
    number = int(corner.partition("/")[0])
    counted = number if number > 0 else vertices + 1 + number
    if number == 0 or counted < 1:
        raise ValueError(f"a face names the vertex {number}, which is not there")
    return counted


def read_stl(data: bytes) -> list[Part]:
    """The triangles of a binary or ASCII file; STL has no units, so its numbers are m. Raises ValueError."""
    import trimesh

    end = 84 + 50 * int.from_bytes(data[80:84], "little")
    if data.lstrip()[:5].lower() != b"solid":
        # trimesh takes a binary file for text if anything follows its triangles.
        data = data[: max(end, 84)]
    elif len(data) != end:
        # A name that is not UTF-8 would need a library that guesses encodings.
        data = data.decode("utf-8", errors="replace").encode()
    scene = trimesh.load_scene(BytesIO(data), "stl", process=False)
    return parts_of(((), mesh) for mesh in scene.geometry.values())
