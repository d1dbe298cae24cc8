"""Named parts of a mesh file, as every format's reader returns them; and the readers of the plain formats, OBJ and STL."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import numpy as np

# Maximum numbers in one file, whose few lines can place one geometry a million times. They bound time and memory.
MOST_FACES = 2_000_000
MOST_PARTS = 100_000


@dataclass(frozen=True, slots=True)
class Part:
    """One part of a mesh file: `vertices` (N, 3) m, `faces` (M, 3) vertex indices, counterclockwise from outside.

    `names` are what a `<submesh>` may call it; the first is the one that Gazebo uses.
    """

    names: tuple[str, ...]
    vertices: np.ndarray
    faces: np.ndarray


def parts_of(meshes: Iterable[tuple[tuple[str, ...], object]]) -> list[Part]:
    """The parts among pairs of names and what trimesh loaded; point clouds and empty meshes are dropped. Raises ValueError."""
    return [_part(names, mesh) for names, mesh in meshes if len(getattr(mesh, "faces", ()))]


def _part(names: tuple[str, ...], mesh: Any) -> Part:
    """A part with only the vertices that its faces use, since many parts may share one long list. Raises ValueError."""
    vertices = mesh.vertices.view(np.ndarray)
    used, places = np.unique(mesh.faces, return_inverse=True)
    # trimesh does not check this, and numpy counts negative numbers from the end.
    if not 0 <= used[0] <= used[-1] < len(vertices):
        raise ValueError("a face refers to a vertex that does not exist")
    if vertices.shape[1] != 3:
        raise ValueError("a vertex has fewer than three numbers")
    return Part(names, vertices[used], places.reshape(-1, 3))


def chosen(parts: Sequence[Part], name: str) -> list[Part]:
    """The parts called `name`, or all if it is empty. Raises ValueError listing the existing names."""
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
    """Vertices and faces of all parts together. Raises ValueError if there are none."""
    if not parts:
        raise ValueError("has no triangles")
    check_count(sum(len(part.faces) for part in parts))
    from trimesh.util import append_faces

    vertices, faces = append_faces([part.vertices for part in parts], [part.faces for part in parts])
    return vertices, faces


def check_count(faces: int) -> None:
    """Raises ValueError for too many triangles."""
    if faces > MOST_FACES:
        raise ValueError(
            f"has {faces / 1e6:.1f} million triangles; the maximum is {MOST_FACES / 1e6:g} million: simplify it"
        )


def read_obj(data: bytes) -> list[Part]:
    """One part for each object and group (`o`, `g`) with faces; polygons become fans. Raises ValueError, IndexError."""
    import trimesh

    check_count(data.count(b"\nf "))
    text, names = _plain(data.decode("utf-8", errors="replace"))
    scene = trimesh.load_scene(BytesIO(text.encode()), "obj", process=False, skip_materials=True, split_objects=True)
    if not names:
        return []
    return parts_of((names[number], scene.geometry[str(number)]) for number in range(len(names)))


def _plain(text: str) -> tuple[str, list[tuple[str, ...]]]:
    """An OBJ file with only vertices and faces, in objects called 0, 1, ..., and the original names of these objects.

    trimesh silently misreads negative indices, the index 0, white space other than single blanks, and corners with and
    without `/` in one object; and it joins the names of object and group.
    """
    vertices: list[str] = []
    objects: dict[tuple[str, ...], list[str]] = {}
    name, group = "", ""
    for line in text.replace("\\\r\n", " ").replace("\\\n", " ").splitlines():
        word, *rest = line.partition("#")[0].split() or [""]
        if word == "v":
            vertices.append("v " + " ".join(rest[:3]))
        elif word == "f" and len(rest) > 2:
            heads = [corner.partition("/")[0] for corner in rest]
            # Plain positive numbers, as almost all are, need no look at each.
            digits = "".join(heads)
            if not (digits.isascii() and digits.isdecimal() and all(heads)) or any(head[0] == "0" for head in heads):
                heads = [str(_counted(head, len(vertices))) for head in heads]
            corners = " ".join(heads)
            # Without objects, groups serve as objects.
            objects.setdefault((name, group) if name else (group,), []).append("f " + corners)
        elif word == "o":
            name, group = " ".join(rest), ""
        elif word == "g":
            group = " ".join(rest)
    faces = [line for number, lines in enumerate(objects.values()) for line in (f"o {number}", *lines)]
    return "\n".join([*vertices, *faces]), list(objects)


def _counted(corner: str, vertices: int) -> int:
    """The 1-based index of a corner's vertex; negative ones count back from the last of the `vertices` before the face."""
    number = int(corner)
    counted = number if number > 0 else vertices + 1 + number
    if number == 0 or counted < 1:
        raise ValueError(f"a face refers to the vertex {number}, which does not exist")
    return counted


def read_stl(data: bytes) -> list[Part]:
    """The triangles of a binary or ASCII file; STL has no units, so metres are assumed. Raises ValueError."""
    import trimesh

    end = 84 + 50 * int.from_bytes(data[80:84], "little")
    if data.lstrip()[:5].lower() != b"solid":
        # trimesh takes a binary file for text if it has trailing bytes.
        check_count((end - 84) // 50)
        data = data[: max(end, 84)]
    elif len(data) != end:
        # For names in other encodings, trimesh would need a library that guesses them.
        data = data.decode("utf-8", errors="replace").encode()
    scene = trimesh.load_scene(BytesIO(data), "stl", process=False)
    return parts_of(((), mesh) for mesh in scene.geometry.values())
