"""Reads COLLADA (.dae) files in the frame in which Gazebo shows them.

As in Gazebo's loader, `<unit>` scales the mesh and `<up_axis>` is ignored: worlds pose their models for Gazebo's view, and
exporters wrote any up axis. Only shapes and their places are read; skinned shapes keep their original pose.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from xml.etree.ElementTree import Element

import numpy as np

from ddenv.world.access import xml_root
from ddenv.world.files.triangles import MOST_PARTS, Part, check_count, fans, part, strip
from ddenv.world.pose import Pose, vector

INSTANCES = ("instance_visual_scene", "instance_node", "instance_geometry", "instance_controller")
PRIMITIVES = ("triangles", "polylist", "polygons", "tristrips", "trifans")


def read_dae(data: bytes) -> list[Part]:
    """Every instance of every geometry in the scene, in m, named by its node, its geometry and their ids.

    Dangling references are skipped, as in Gazebo. Raises Unusable, ValueError, and other exceptions for malformed files.
    """
    root = xml_root(data)
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
    if root.tag != "COLLADA":
        raise ValueError(f"its root is <{root.tag[:60]}>, not <COLLADA>")
    known = {id: element for element in root.iter() if (id := element.get("id"))}
    instance = root.find("scene/instance_visual_scene")
    scene = None if instance is None else _target(instance, known)
    if scene is None:
        raise ValueError("has no scene")
    shapes: dict[Element, list[tuple[np.ndarray, np.ndarray]]] = {}
    found: list[Part] = []
    nodes = _nodes(scene, "", np.diag([*[_metres(root)] * 3, 1.0]), known)
    for number, (node, name, place) in enumerate(nodes):
        for geometry in (target for each in node if (target := _target(each, known)) is not None):
            if geometry.tag != "geometry":
                continue
            if geometry not in shapes:
                shapes[geometry] = [shape for mesh in geometry.iterfind("mesh") for shape in _shapes(mesh, known)]
            names = (name, geometry.get("name", ""), geometry.get("id", ""), node.get("id", ""))
            found += [part(names, vertices, faces, place) for vertices, faces in shapes[geometry]]
            check_count(sum(len(each.faces) for each in found))
        # A few lines can place one geometry a million times.
        if max(number, len(found)) > MOST_PARTS:
            raise ValueError("places its geometries too often")
    return found


def _metres(root: Element) -> float:
    """The length of one unit of the file, m; 1 if that is missing or nonsense."""
    unit = root.find("asset/unit")
    try:
        metres = float("1" if unit is None else unit.get("meter", "1"))
    except ValueError:
        return 1.0
    return metres if math.isfinite(metres) and metres > 0 else 1.0


def _target(instance: Element, known: dict[str, Element]) -> Element | None:
    """The element that an instance places; other files are not opened."""
    target = known.get(instance.get("url", "")[1:]) if instance.tag in INSTANCES else None
    if target is not None and target.tag == "controller":
        return known.get("".join(skin.get("source", "")[1:] for skin in target.iterfind("skin")))
    return target


def _nodes(
    node: Element, name: str, place: np.ndarray, known: dict[str, Element]
) -> Iterator[tuple[Element, str, np.ndarray]]:
    """`node` and all nodes below it, with their names and places (4, 4). One without a name takes its parent's.

    Raises RecursionError if a node contains itself.
    """
    yield node, name, place
    for each in node:
        inner = each if each.tag == "node" else _target(each, known)
        if inner is not None and inner.tag == "node":
            yield from _nodes(inner, inner.get("name") or name, place @ _transform(inner), known)


def _transform(node: Element) -> np.ndarray:
    """The place (4, 4) of a node in its parent."""
    whole = np.eye(4)
    for each in node:
        own = np.eye(4)
        match each.tag:
            case "matrix":
                own = _numbers(each).reshape(4, 4)
            case "translate":
                own[:3, 3] = _numbers(each).reshape(3)
            case "scale":
                own[:3, :3] = np.diag(_numbers(each).reshape(3))
            case "rotate":
                *axis, angle = _numbers(each).reshape(4).tolist()
                # An axis of length zero turns nothing.
                if length := math.hypot(*axis):
                    own[:3, :3] = Pose.about(vector(one / length for one in axis), math.radians(angle)).rotation()
        whole = whole @ own
    return whole


def _shapes(mesh: Element, known: dict[str, Element]) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """The vertices (N, 3) and the faces (M, 3) of each primitive with faces. Raises ValueError."""
    for primitive in (each for each in mesh if each.tag in PRIMITIVES):
        # Holes of polygons are dropped.
        paths = [_numbers(path, int) for path in (*primitive.iterfind("p"), *primitive.iterfind("ph/p"))]
        offsets = {each.get("semantic"): int(each.get("offset", 0)) for each in primitive.iterfind("input")}
        source = primitive.find("input[@semantic='VERTEX']")
        if not any(map(len, paths)):
            continue
        if source is None or min(offsets.values()) < 0:
            raise ValueError(f"<{primitive.tag}> has no vertices")
        corners = [path.reshape(-1, max(offsets.values()) + 1)[:, offsets["VERTEX"]] for path in paths]
        if len(faces := _faces(primitive, corners)):
            yield _vertices(source, known), faces


def _faces(primitive: Element, corners: list[np.ndarray]) -> np.ndarray:
    """The triangles (M, 3) of a primitive; `corners` are those of each `<p>`. Raises ValueError."""
    joined = np.concatenate(corners)
    check_count(len(joined) // 3)
    match primitive.tag:
        case "triangles":
            return joined.reshape(-1, 3)
        case "tristrips":
            return np.vstack([strip(each) for each in corners])
        case "polylist":
            counts = _numbers(primitive.find("vcount"), int)
            if len(counts) and (counts.min() < 0 or counts.max() > len(joined) or counts.sum() > len(joined)):
                raise ValueError("<vcount> does not match <p>")
            return fans(joined, counts)
    return fans(joined, np.array([len(each) for each in corners]))


def _vertices(source: Element, known: dict[str, Element]) -> np.ndarray:
    """The vertices (N, 3) that a primitive refers to, in the file's unit."""
    place = known[source.get("source", "")[1:]].find("input[@semantic='POSITION']")
    positions = known["" if place is None else place.get("source", "")[1:]]
    accessor = next(positions.iter("accessor"), positions)
    stride = int(accessor.get("stride", 3))
    values = _numbers(positions.find("float_array"))[int(accessor.get("offset", 0)) :]
    rows = values[: len(values) // stride * stride].reshape(-1, stride)[:, :3].reshape(-1, 3)
    # As in the other formats, which takes half the room in a run file.
    return rows.astype("<f4")


def _numbers(element: Element | None, kind: type = float) -> np.ndarray:
    text = "" if element is None else element.text or ""
    return np.array([kind(word) for word in text.split()], dtype=kind)
