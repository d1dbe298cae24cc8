"""Named parts of a mesh file, as every format's reader returns them; and the readers of the plain
formats, OBJ and STL.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from io import BytesIO
from itertools import pairwise
from typing import Any

import numpy as np

# Maximum numbers in one file, whose few lines can place one geometry a million times. They bound
# time and memory.
MOST_FACES = 2_000_000
MOST_PARTS = 100_000


@dataclass(frozen=True, slots=True)
class Part:
    """One part of a mesh file: `vertices` (N, 3) m, `faces` (M, 3) vertex indices, counterclockwise
    from outside.

    `names` are what a `<submesh>` may call it; the first is the one that Gazebo uses.
    """

    names: tuple[str, ...]
    vertices: np.ndarray
    faces: np.ndarray


def parts_of(meshes: Iterable[tuple[tuple[str, ...], Any]]) -> list[Part]:
    """The parts among pairs of names and what trimesh loaded; point clouds and empty meshes are
    dropped. Raises ValueError.
    """
    found = [(names, mesh) for names, mesh in meshes if len(getattr(mesh, "faces", ()))]
    return [used_part(names, mesh.vertices.view(np.ndarray), mesh.faces) for names, mesh in found]


def used_part(names: tuple[str, ...], vertices: np.ndarray, faces: np.ndarray) -> Part:
    """A part with only the vertices that its faces use, since many parts may share one long list.
    Raises ValueError.
    """
    used, places = np.unique(faces, return_inverse=True)
    # trimesh does not check this, and numpy counts negative numbers from the end.
    if not 0 <= used[0] <= used[-1] < len(vertices):
        raise ValueError("a face refers to a vertex that does not exist")
    if vertices.shape[1] != 3:
        raise ValueError("a vertex has fewer than three numbers")
    return Part(names, vertices[used], places.reshape(-1, 3))


def chosen(parts: Sequence[Part], name: str) -> list[Part]:
    """The parts called `name`, or all if it is empty. Raises ValueError listing the existing
    names.
    """
    if not name:
        return list(parts)
    for rank in range(max((len(part.names) for part in parts), default=0)):
        if found := [part for part in parts if part.names[rank : rank + 1] == (name,)]:
            return found
    known = list(dict.fromkeys(part.names[0] for part in parts if part.names and part.names[0]))
    listed = ", ".join(f"'{each[:60]}'" for each in known[:5]) or "none with a name"
    raise ValueError(
        f"has no submesh '{name[:60]}'; it has {listed}{', ...' if len(known) > 5 else ''}"
    )


def joined(parts: Sequence[Part]) -> tuple[np.ndarray, np.ndarray]:
    """Vertices and faces of all parts together. Raises ValueError if there are none."""
    if not parts:
        raise ValueError("has no triangles")
    check_count(sum(len(part.faces) for part in parts))
    counts = [len(part.vertices) for part in parts]
    starts = np.cumsum(counts) - counts
    faces = [part.faces + start for part, start in zip(parts, starts, strict=True)]
    return np.concatenate([part.vertices for part in parts]), np.concatenate(faces)


def check_count(faces: int) -> None:
    """Raises ValueError for too many triangles."""
    if faces > MOST_FACES:
        raise ValueError(
            f"has {faces / 1e6:.1f} million triangles; the maximum is {MOST_FACES / 1e6:g} "
            "million: simplify it"
        )


def read_obj(data: bytes) -> list[Part]:
    """One part for each object and group (`o`, `g`) with faces; polygons become fans. Raises
    ValueError.

    Not by trimesh: it misreads negative indices, the index 0 and white space, and joins the names
    of object and group.
    """
    check_count(data.count(b"\nf "))
    vertices: list[list[str]] = []
    objects: dict[tuple[str, ...], list[tuple[int, int, int]]] = {}
    name = ""
    group = ""
    for line in (
        data.decode("utf-8", errors="replace")
        .replace("\\\r\n", " ")
        .replace("\\\n", " ")
        .splitlines()
    ):
        word, *rest = line.partition("#")[0].split() or [""]
        if word == "v":
            vertices.append(rest[:3])
        elif word == "f" and len(rest) > 2:
            numbers = [int(corner.partition("/")[0]) for corner in rest]
            # Negative numbers count back from the last vertex before the face.
            first, *others = [
                number - 1 if number > 0 else len(vertices) + number for number in numbers
            ]
            if 0 in numbers or min(first, *others) < 0:
                raise ValueError(
                    f"a face refers to the vertex {min(numbers)}, which does not exist"
                )
            # Without objects, groups serve as objects.
            faces = objects.setdefault((name, group) if name else (group,), [])
            faces += [(first, second, third) for second, third in pairwise(others)]
        elif word == "o":
            name = " ".join(rest)
            group = ""
        elif word == "g":
            group = " ".join(rest)
    points = np.array(vertices, dtype=float) if objects else np.zeros((0, 3))
    return [used_part(names, points, np.array(faces)) for names, faces in objects.items()]


def read_stl(data: bytes) -> list[Part]:
    """The triangles of a binary or ASCII file; STL has no units, so metres are assumed. Raises
    ValueError.
    """
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
