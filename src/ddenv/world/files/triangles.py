"""Named parts of a mesh file, as every format's reader returns them; and the readers of the plain formats, OBJ and STL."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass

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


def part(names: tuple[str, ...], vertices: np.ndarray, faces: np.ndarray, place: np.ndarray | None = None) -> Part:
    """A part with only the vertices that its faces use, since many parts may share one long list.

    `place` (4, 4) is the transform of the part into the frame of the file. Raises ValueError.
    """
    used, numbers = np.unique(faces, return_inverse=True)
    # numpy counts negative numbers from the end.
    if len(used) and not 0 <= used[0] <= used[-1] < len(vertices):
        raise ValueError("a face refers to a vertex that does not exist")
    points, numbers = vertices[used].astype(float), numbers.reshape(-1, 3)
    if place is None:
        return Part(names, points, numbers)
    # Without BLAS, whose sums may differ between machines.
    points = points[:, :1] * place[:3, 0] + points[:, 1:2] * place[:3, 1] + points[:, 2:] * place[:3, 2] + place[:3, 3]
    # Mirroring turns a surface inside out: reverse its faces.
    return Part(names, points, numbers[:, ::-1] if np.linalg.det(place[:3, :3]) < 0 else numbers)


def fans(corners: np.ndarray, counts: np.ndarray) -> np.ndarray:
    """The triangles (M, 3) of polygons whose corners stand one after the other; `counts` are the corners of each."""
    faces = np.maximum(counts - 2, 0)
    first = np.repeat(np.cumsum(counts) - counts, faces)
    second = first + 1 + np.arange(len(first)) - np.repeat(np.cumsum(faces) - faces, faces)
    triangles: np.ndarray = corners[np.column_stack([first, second, second + 1])]
    return triangles


def strip(corners: np.ndarray) -> np.ndarray:
    """The triangles (M, 3) of a strip; every second one runs the other way round."""
    triangles = np.column_stack([corners[:-2], corners[1:-1], corners[2:]])
    triangles[1::2] = triangles[1::2, ::-1]
    return triangles


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
    firsts = np.cumsum([0, *(len(part.vertices) for part in parts[:-1])])
    faces = [part.faces + first for part, first in zip(parts, firsts, strict=True)]
    return np.vstack([part.vertices for part in parts]), np.vstack(faces)


def check_count(faces: int) -> None:
    """Raises ValueError for too many triangles."""
    if faces > MOST_FACES:
        raise ValueError(
            f"has {faces / 1e6:.1f} million triangles; the maximum is {MOST_FACES / 1e6:g} million: simplify it"
        )


def read_obj(data: bytes) -> list[Part]:
    """One part for each object and group (`o`, `g`) with faces; polygons become fans. Raises ValueError."""
    check_count(data.count(b"\nf "))
    vertices: list[list[float]] = []
    polygons: dict[tuple[str, ...], list[list[int]]] = {}
    name, group = "", ""
    text = data.decode("utf-8", errors="replace")
    for line in text.replace("\\\r\n", " ").replace("\\\n", " ").splitlines():
        word, *rest = line.partition("#")[0].split() or [""]
        if word == "v":
            if len(rest) < 3:
                raise ValueError("a vertex has fewer than three numbers")
            vertices.append([float(number) for number in rest[:3]])
        elif word == "f" and len(rest) > 2:
            corners = [_counted(corner.partition("/")[0], len(vertices)) for corner in rest]
            # Without objects, groups serve as objects.
            polygons.setdefault((name, group) if name else (group,), []).append(corners)
        elif word == "o":
            name, group = " ".join(rest), ""
        elif word == "g":
            group = " ".join(rest)
    points = np.array(vertices).reshape(-1, 3)
    return [part(names, points, _triangles(each)) for names, each in polygons.items()]


def _triangles(polygons: list[list[int]]) -> np.ndarray:
    corners = np.array([corner for polygon in polygons for corner in polygon])
    return fans(corners, np.array([len(polygon) for polygon in polygons]))


def _counted(corner: str, vertices: int) -> int:
    """The number from 0 of a corner's vertex; negative ones count back from the last of the `vertices` before the face."""
    number = int(corner)
    counted = number - 1 if number > 0 else vertices + number
    if number == 0 or counted < 0:
        raise ValueError(f"a face refers to the vertex {number}, which does not exist")
    return counted


# One triangle of a binary file: its normal, its corners, and two bytes of anything.
_STL = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("more", "<u2")])
_STL_VERTEX = re.compile(rb"\bvertex\s+(\S+)\s+(\S+)\s+(\S+)")


def read_stl(data: bytes) -> list[Part]:
    """The triangles of a binary or ASCII file; STL has no units, so metres are assumed. Raises ValueError."""
    count = int.from_bytes(data[80:84], "little")
    if data.lstrip()[:5].lower() != b"solid" or len(data) == 84 + _STL.itemsize * count:
        check_count(count)
        points = np.frombuffer(data, _STL, count, 84)["corners"].reshape(-1, 3)
    else:
        points = np.array([[float(number) for number in found] for found in _STL_VERTEX.findall(data)]).reshape(-1, 3)
    return [part((), points, np.arange(len(points)).reshape(-1, 3))]
