"""Reads glTF 2.0 files (.gltf, .glb) with trimesh, in the axes of the file.

glTF is Y-up, but Gazebo uses the coordinates of every format as they are, and lets the `<pose>` in
the SDF turn the mesh upright. So do we. trimesh gets a header that holds only the shape: otherwise
it would decode images, drop nodes below a camera, and misread what it does not support.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator
from io import BytesIO
from pathlib import Path
from urllib.parse import unquote

from ddenv.text import Data
from ddenv.world.access import Unusable, read
from ddenv.world.files.triangles import MOST_PARTS, Part, check_count, parts_of

# Accepted accessors of positions (32-bit floats) and of vertex indices (8, 16 and 32 bits).
_POSITIONS = ("VEC3", (5126,))
_INDICES = ("SCALAR", (5121, 5123, 5125))
_TRIANGLES = 4
_STRIP = 5
_FAN = 6
_PLACE = ("children", "matrix", "translation", "rotation", "scale")
# Replaces accessors that are not read.
_NOTHING = {"componentType": 5126, "count": 0, "type": "SCALAR"}


def read_gltf(data: bytes, folder: Path, limit: int) -> list[Part]:
    """Every mesh of every node in the scene, named by its node and its mesh.

    Also reads buffers in `folder`, of at most `limit` bytes each. Raises ValueError or Unusable,
    and any exception of trimesh for malformed files.
    """
    import trimesh

    is_binary = data.startswith(b"glTF")
    # The header of a .glb is its first chunk, after 12 bytes, the chunk's size and its type.
    end = 20 + int.from_bytes(data[12:16], "little")
    header = json.loads(data[20:end] if is_binary else data)
    text = json.dumps(_shape(header, limit), allow_nan=False).encode()
    if is_binary:
        text = data[:12] + len(text).to_bytes(4, "little") + data[16:20] + text + data[end:]
    uris = {
        each["uri"] for each in header["buffers"] if "base64," not in each.get("uri", "base64,")
    }
    buffers = {uri: _buffer(uri, folder, limit) for uri in uris}
    scene = trimesh.load_scene(
        BytesIO(text), "glb" if is_binary else "gltf", resolver=buffers, process=False
    )
    # trimesh appends random letters to the names of nodes with several primitives.
    placed = [(int(mesh.metadata["node"].partition("_")[0]), mesh) for mesh in scene.dump()]
    nodes = header["nodes"]
    meshes = header["meshes"]
    return parts_of(
        (
            (
                str(nodes[number].get("name", "")),
                str(meshes[nodes[number]["mesh"]].get("name", "")),
            ),
            mesh,
        )
        for number, mesh in sorted(placed, key=lambda pair: pair[0])
    )


def _buffer(uri: str, folder: Path, limit: int) -> bytes:
    """The content of a buffer file in `folder`. Raises ValueError or Unusable."""
    name = os.path.normpath(unquote(uri, errors="surrogateescape"))
    if ":" in name or name.startswith(("/", "..")) or "\0" in name:
        raise ValueError(f"buffer '{uri[:60]}' is outside the file's folder")
    try:
        return read(folder / name, limit)
    except Unusable as error:
        raise Unusable(f"buffer '{uri[:60]}': {error}") from None


def _shape(header: Data, limit: int) -> Data:
    """The header reduced to triangles and their transforms; a node's name is its number. Raises
    ValueError.
    """
    if compressed := [name for name in header.get("extensionsRequired", []) if "compress" in name]:
        raise ValueError(f"{compressed[0][:60]} is not supported; save it without compression")
    accessors = header["accessors"]
    views = header["bufferViews"]
    nodes = header["nodes"]
    # numpy would count negative numbers from the end, and trimesh would drop such a mesh.
    counts = ("byteOffset", "byteLength", "count", "mesh")
    if any(each.get(key, 0) < 0 for each in (*accessors, *views, *nodes) for key in counts):
        raise ValueError("has negative numbers")
    # Each view is copied.
    if sum(each["byteLength"] for each in views) > limit:
        raise ValueError("its buffer views are larger than its buffers")
    meshes = [list(_primitives(mesh, accessors)) for mesh in header["meshes"]]
    # Primitives may share accessors, so a small file can have any number of triangles.
    placed = [primitive for node in nodes if "mesh" in node for primitive in meshes[node["mesh"]]]
    for primitives in (placed, [primitive for mesh in meshes for primitive in mesh]):
        check_count(sum(_size(each, accessors) for each in primitives))
        if len(primitives) > MOST_PARTS:
            raise ValueError(f"has more than {MOST_PARTS} parts")
    used = {
        number
        for mesh in meshes
        for each in mesh
        for number in (*each["attributes"].values(), each.get("indices"))
    }
    # A node without the mesh if that has no triangles: trimesh would lose the transform for all
    # nodes below.
    placing = [
        {"name": str(number)}
        | {key: node[key] for key in _PLACE if key in node}
        | ({"mesh": node["mesh"]} if "mesh" in node and meshes[node["mesh"]] else {})
        for number, node in enumerate(nodes)
    ]
    return {
        "asset": {"version": header["asset"]["version"]},
        "scenes": [{"nodes": _roots(header)}],
        "nodes": placing,
        "meshes": [{"primitives": mesh} for mesh in meshes],
        "accessors": [
            each if number in used else _NOTHING for number, each in enumerate(accessors)
        ],
        "bufferViews": views,
        "buffers": header["buffers"],
    }


def _primitives(mesh: Data, accessors: list[Data]) -> Iterator[Data]:
    """The triangle primitives of a mesh, without normals, colours and materials. Raises
    ValueError.
    """
    for primitive in mesh["primitives"]:
        mode = primitive.get("mode", _TRIANGLES)
        position = primitive["attributes"].get("POSITION")
        if mode == _FAN:
            raise ValueError("triangle fans are not supported")
        if mode not in (_TRIANGLES, _STRIP) or position is None:
            continue
        indices = {"indices": primitive["indices"]} if "indices" in primitive else {}
        for number, (kind, codes) in (
            (position, _POSITIONS),
            *((number, _INDICES) for number in indices.values()),
        ):
            accessor = accessors[number]
            plain = "bufferView" in accessor and "sparse" not in accessor
            if not plain or accessor["type"] != kind or accessor["componentType"] not in codes:
                raise ValueError(f"the type of accessor {number} is not supported")
        yield {"mode": mode, "attributes": {"POSITION": position}, **indices}


def _size(primitive: Data, accessors: list[Data]) -> int:
    """The larger of its number of vertices and its maximum number of triangles."""
    corners: int = accessors[primitive["indices"]]["count"] if "indices" in primitive else 0
    faces = corners // 3 if primitive["mode"] == _TRIANGLES else corners
    vertices: int = accessors[primitive["attributes"]["POSITION"]]["count"]
    return max(vertices, faces)


def _roots(header: Data) -> list[int]:
    """The root nodes of the scene. Raises ValueError unless the nodes form trees."""
    nodes = header["nodes"]
    roots: list[int] = header["scenes"][header.get("scene", 0)]["nodes"]
    listed = [*roots, *(child for node in nodes for child in node.get("children", []))]
    # glTF requires trees; trimesh would keep one parent of a node with two.
    if (
        len(set(listed)) < len(listed)
        or not set(listed) <= {*range(len(nodes))}
        or len(nodes) > MOST_PARTS
    ):
        raise ValueError("its nodes do not form a tree")
    return roots
