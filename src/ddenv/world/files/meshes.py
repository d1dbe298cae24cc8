"""Reads mesh files (obj, stl, dae, gltf, glb) as `Mesh`, and packs meshes into bytes for the run
file.

Coordinates are as in Gazebo: the axes of the file whatever it says about "up", `<unit>` of a .dae
applied, all instances of a scene placed and joined. Only the mesh file itself is opened, and the
buffers of a .gltf.

Limitations: a .dae is refused if it has no scene, or if its positions have gaps. A .gltf is refused
if it has no scene, or if it has triangle fans or compressed, sparse or quantized meshes. A text
.stl is read up to its last `endsolid`.
"""

from __future__ import annotations

import hashlib
import logging
import struct
import warnings
from pathlib import Path

import numpy as np

from ddenv.text import truncated
from ddenv.world.access import Unusable, read
from ddenv.world.files.dae import read_dae
from ddenv.world.files.gltf import read_gltf
from ddenv.world.files.triangles import Part, check_count, chosen, joined, read_obj, read_stl
from ddenv.world.hull import Surface, convex_hull
from ddenv.world.model import Mesh

SUFFIXES = (".obj", ".stl", ".dae", ".gltf", ".glb")
MESH_LIMIT = 200_000_000  # bytes of a file
# Maximum number of faces drawn; beyond it a visual becomes its hull, since a browser would stall.
MOST_DRAWN = 50_000
FARTHEST = 1e6  # of a vertex from the origin, m
_MAGIC = b"ddmesh1\0"
# Begins a mesh that is drawn as its hull, since it has more than `MOST_DRAWN` faces.
_MAGIC_HULL = b"ddmesh1h"
_HEADER = struct.Struct("<8sIII")
_COUNT = struct.Struct("<I")


def read_parts(path: Path) -> list[Part]:
    """The named parts of a mesh file, as triangles. Raises Unusable, with a reason in one line."""
    suffix = path.suffix.lower()
    if suffix not in SUFFIXES:
        raise Unusable(
            f"meshes of type '{suffix[:20]}' are not supported; use one of {', '.join(SUFFIXES)}"
        )
    data = read(path, MESH_LIMIT)
    logging.getLogger("trimesh").setLevel(logging.CRITICAL)
    try:
        with np.errstate(all="ignore"), warnings.catch_warnings():
            warnings.simplefilter("ignore")
            # Of older numpy versions, about numbers that are half read.
            warnings.filterwarnings("error", message="string or file could not be read")
            plain = {".obj": read_obj, ".stl": read_stl, ".dae": read_dae}.get(suffix)
            if plain is None:
                return read_gltf(data, path.parent, MESH_LIMIT)
            return plain(data)
    except Unusable:
        raise
    except MemoryError:
        raise Unusable("needs more memory than is available") from None
    except RecursionError:
        reason = "it is nested too deeply"
    except KeyError as error:
        reason = f"it has no {error}"
    # Readers may raise anything for a malformed file.
    except Exception as error:
        reason = str(error) or "its numbers are inconsistent"
    raise Unusable(f"is not a valid {suffix[1:].upper()} file: {_line(reason)}") from None


def _line(text: str) -> str:
    return truncated(" ".join(text.split()), 200)


def build(
    parts: list[Part], submesh: str = "", center: bool = False, convex: bool = False
) -> bytes:
    """The mesh of all `parts`, or of those called `submesh`, packed.

    It is centred as by `surface_of`. A `convex` mesh, and one of more than `MOST_DRAWN` faces, is
    replaced by its hull. Raises Unusable.
    """
    vertices, faces = surface_of(parts, submesh, center)
    too_fine = not convex and len(faces) > MOST_DRAWN
    try:
        if convex or too_fine:
            vertices, faces = convex_hull(vertices)
        else:
            # Without duplicate vertices.
            vertices, places = np.unique(vertices, axis=0, return_inverse=True)
            faces = places.reshape(-1)[faces]
    except ValueError as error:
        raise Unusable(_line(str(error))) from None
    return pack(vertices, faces, simplified=too_fine)


def surface_of(parts: list[Part], submesh: str, center: bool) -> Surface:
    """Vertices (N, 3) m and faces (M, 3) of all `parts`, or of those called `submesh`. Raises
    Unusable.

    `center` moves the middle of its bounding box to the origin.
    """
    try:
        vertices, faces = joined(chosen(parts, submesh))
        _check(vertices, faces)
    except ValueError as error:
        raise Unusable(_line(str(error))) from None
    if center:
        vertices = vertices - (vertices.min(axis=0) + vertices.max(axis=0)) / 2
    # Adding zero makes -0.0 the same as 0.0.
    return vertices + 0.0, faces


def _check(vertices: np.ndarray, faces: np.ndarray) -> None:
    """Raises ValueError unless all numbers are valid."""
    if not len(faces):
        raise ValueError("has no triangles")
    check_count(len(faces))
    if faces.min() < 0 or faces.max() >= len(vertices):
        raise ValueError("has faces with vertices that do not exist")
    if not np.isfinite(vertices).all():
        raise ValueError("has vertices that are not finite")
    if np.abs(vertices).max() > FARTHEST:
        raise ValueError(f"has vertices farther than {FARTHEST:.0f} m from its origin")


def pack(vertices: np.ndarray, faces: np.ndarray, *, simplified: bool = False) -> bytes:
    """Header, vertices and faces as little-endian bytes; vertices in 32 bits if that loses no
    precision, as for most files.
    """
    short = vertices.astype("<f4")
    kept = short if np.array_equal(short.astype("<f8"), vertices) else vertices.astype("<f8")
    header = _HEADER.pack(
        _MAGIC_HULL if simplified else _MAGIC, kept.itemsize, len(vertices), len(faces)
    )
    return header + kept.tobytes() + faces.astype("<u4").tobytes()


def unpack(name: str, packed: bytes) -> Mesh:
    """The packed mesh, with read-only arrays. Raises Unusable for damaged bytes.

    Its `origin` is `name` with a digest of its content, which distinguishes files of one name.
    """
    known = len(packed) >= _HEADER.size and packed.startswith((_MAGIC, _MAGIC_HULL))
    _, size, count, triangles = _HEADER.unpack_from(packed) if known else (b"", 0, 0, 0)
    start = _HEADER.size + 3 * size * count
    if size not in (4, 8) or len(packed) != start + 12 * triangles:
        raise Unusable("its stored mesh is damaged")
    vertices = (
        np.frombuffer(packed, f"<f{size}", 3 * count, _HEADER.size)
        .reshape(-1, 3)
        .astype(np.float64)
    )
    faces = np.frombuffer(packed, "<u4", 3 * triangles, start).reshape(-1, 3).astype(np.uint32)
    try:
        _check(vertices, faces)
    except ValueError as error:
        raise Unusable(f"its stored mesh is damaged: {error}") from None
    vertices.flags.writeable = faces.flags.writeable = False
    digest = hashlib.blake2b(packed, digest_size=8).hexdigest()
    return Mesh(f"{name} {digest}", vertices, faces, packed.startswith(_MAGIC_HULL))


def pack_pieces(pieces: list[Surface]) -> bytes:
    """Their number, the size of each, and each as `pack` gives it."""
    packed = [pack(*piece) for piece in pieces]
    sizes = [len(packed), *map(len, packed)]
    return b"".join([*map(_COUNT.pack, sizes), *packed])


def unpack_pieces(name: str, packed: bytes) -> list[Mesh]:
    """The packed pieces, each as `unpack` gives it. Raises Unusable for damaged bytes."""
    sizes = [
        size for (size,) in _COUNT.iter_unpack(packed[: len(packed) // _COUNT.size * _COUNT.size])
    ]
    if not sizes or sizes[0] >= len(sizes):
        raise Unusable("its stored mesh is damaged")
    start = _COUNT.size * (1 + sizes[0])
    pieces = []
    for number, size in enumerate(sizes[1 : 1 + sizes[0]]):
        pieces.append(unpack(f"{name} {number}", packed[start : start + size]))
        start += size
    return pieces
