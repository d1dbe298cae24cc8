"""Reads glTF 2.0 files (.gltf, .glb), in the axes of the file.

glTF is Y-up, but Gazebo uses the coordinates of every format as they are, and lets the `<pose>` in the SDF turn the mesh
upright. So do we.
"""

from __future__ import annotations

import base64
import json
import os
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import numpy as np

from ddenv.world.access import Unusable, read
from ddenv.world.files.triangles import MOST_PARTS, Part, check_count, fans, part, strip
from ddenv.world.pose import ONE, pose_of

# The accessors of positions and of vertex indices: their type, how many numbers a row has, and these in each format.
_POSITIONS = ("VEC3", 3, {5126: "<f4"})
_INDICES = ("SCALAR", 1, {5121: "<u1", 5123: "<u2", 5125: "<u4"})
_TRIANGLES, _STRIP, _FAN = 4, 5, 6


def read_gltf(data: bytes, folder: Path, limit: int) -> list[Part]:
    """Every mesh of every node in the scene, named by its node and its mesh.

    Also reads buffers in `folder`, of at most `limit` bytes each. Raises ValueError or Unusable, and other exceptions for
    malformed files.
    """
    # A .glb has a header and a buffer in chunks, after 12 bytes; each begins with its size and its type.
    end = 20 + int.from_bytes(data[12:16], "little")
    header = json.loads(data[20:end] if data.startswith(b"glTF") else data)
    if not str(header["asset"]["version"]).startswith("2."):
        raise ValueError("only GLTF 2 is supported")
    if compressed := [name for name in header.get("extensionsRequired", []) if "compress" in name]:
        raise ValueError(f"{compressed[0][:60]} is not supported; save it without compression")
    chunk = data[end + 8 :]
    buffers = [_buffer(each["uri"], folder, limit) if "uri" in each else chunk for each in header["buffers"]]
    found: list[Part] = []
    for node, place in _placed(header):
        mesh = _at(header["meshes"], node["mesh"]) if "mesh" in node else {"primitives": []}
        for primitive in mesh["primitives"]:
            position = primitive["attributes"].get("POSITION")
            if position is None or primitive.get("mode", _TRIANGLES) not in (_TRIANGLES, _STRIP, _FAN):
                continue
            vertices = _rows(position, _POSITIONS, header, buffers)
            corners = np.arange(len(vertices))
            if "indices" in primitive:
                corners = _rows(primitive["indices"], _INDICES, header, buffers).ravel().astype(int)
            names = str(node.get("name", "")), str(mesh.get("name", ""))
            found.append(part(names, vertices, _faces(primitive, corners), place))
        # Primitives may share accessors, so a small file can have any number of triangles.
        check_count(sum(len(each.faces) for each in found))
        if len(found) > MOST_PARTS:
            raise ValueError(f"has more than {MOST_PARTS} parts")
    return [each for each in found if len(each.faces)]


def _buffer(uri: str, folder: Path, limit: int) -> bytes:
    """The content of a buffer: in its URI, or a file in `folder`. Raises ValueError or Unusable."""
    if "base64," in uri:
        return base64.b64decode(uri.partition("base64,")[2], validate=True)
    name = os.path.normpath(unquote(uri, errors="surrogateescape"))
    if ":" in name or name.startswith(("/", "..")) or "\0" in name:
        raise ValueError(f"buffer '{uri[:60]}' is outside the file's folder")
    try:
        return read(folder / name, limit)
    except Unusable as error:
        raise Unusable(f"buffer '{uri[:60]}': {error}") from None


def _placed(header: dict[str, Any]) -> Iterator[tuple[dict[str, Any], np.ndarray]]:
    """The nodes of the scene with their places (4, 4). Raises ValueError unless the nodes form trees."""
    nodes = header["nodes"]
    roots: list[int] = header["scenes"][header.get("scene", 0)]["nodes"]
    listed = [*roots, *(child for node in nodes for child in node.get("children", []))]
    if len(set(listed)) < len(listed) or not set(listed) <= {*range(len(nodes))} or len(nodes) > MOST_PARTS:
        raise ValueError("its nodes do not form a tree")
    left = [(root, np.eye(4)) for root in roots]
    while left:
        number, above = left.pop(0)
        place = above @ _transform(nodes[number])
        yield nodes[number], place
        left += [(child, place) for child in nodes[number].get("children", [])]


def _transform(node: dict[str, Any]) -> np.ndarray:
    """The place (4, 4) of a node in its parent."""
    if "matrix" in node:
        return np.array(node["matrix"], dtype=float).reshape(4, 4).T
    x, y, z, w = node.get("rotation", (0, 0, 0, 1))
    place = np.eye(4)
    place[:3, :3] = pose_of((0, 0, 0, w, x, y, z)).rotation() * np.array(node.get("scale", ONE), dtype=float).reshape(3)
    place[:3, 3] = np.array(node.get("translation", (0, 0, 0)), dtype=float).reshape(3)
    return place


def _faces(primitive: dict[str, Any], corners: np.ndarray) -> np.ndarray:
    match primitive.get("mode", _TRIANGLES):
        case 5:
            return strip(corners)
        case 6:
            return fans(corners, np.array([len(corners)]))
    return corners.reshape(-1, 3)


def _rows(
    number: int, wanted: tuple[str, int, dict[int, str]], header: dict[str, Any], buffers: list[bytes]
) -> np.ndarray:
    """The rows (N, 1) or (N, 3) of an accessor, which is to be as `wanted`. Raises ValueError."""
    accessor, (kind, width, formats) = _at(header["accessors"], number), wanted
    plain = "bufferView" in accessor and "sparse" not in accessor
    if not plain or accessor["type"] != kind or accessor["componentType"] not in formats:
        raise ValueError(f"the type of accessor {number} is not supported")
    # Three indices make a triangle.
    check_count(accessor["count"] if width == 3 else accessor["count"] // 3)
    view, each = _at(header["bufferViews"], accessor["bufferView"]), np.dtype(formats[accessor["componentType"]])
    start, stride = view.get("byteOffset", 0), view.get("byteStride", width * each.itemsize)
    if start < 0 or stride < width * each.itemsize:
        raise ValueError(f"the values of accessor {number} overlap or have no place")
    content = memoryview(_at(buffers, view["buffer"]))[start : start + view["byteLength"]]
    strides = (stride, each.itemsize)
    return np.ndarray((accessor["count"], width), each, content, accessor.get("byteOffset", 0), strides)


def _at(items: list[Any], number: int) -> Any:
    # Python would count negative numbers from the end.
    if number < 0:
        raise ValueError("has negative numbers")
    return items[number]
