"""Reads COLLADA (.dae) files in the frame in which Gazebo shows them.

As in Gazebo's loader, `<unit>` scales the mesh and `<up_axis>` is ignored: worlds pose their models
for Gazebo's view, and exporters wrote any up axis. Of several elements of one kind that share an id
the first counts: exporters give one id to elements of different kinds. Only positions are read, so
that errors in materials, lights, animations and skeletons do no harm.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ddenv.world.files.triangles import Part, check_count, used_part
from ddenv.world.tinyxml import Element, parse_xml

# What the URL of each instance names.
TARGETS = {
    "instance_visual_scene": "visual_scene",
    "instance_node": "node",
    "instance_geometry": "geometry",
    "instance_controller": "controller",
}
PRIMITIVES = ("triangles", "polylist", "polygons", "tristrips", "trifans")
# Maximum size of the expanded scene, bytes: a few lines can place one geometry a million times.
MOST_WEIGHT = 400_000_000


def read_dae(data: bytes) -> list[Part]:
    """Every instance of every geometry in the scene, in m, named by its node, its geometry and
    their ids.

    Dangling references are skipped, as in Gazebo. Raises NotXml and ValueError, and RecursionError
    if a node contains itself.
    """
    root = parse_xml(data, Path())
    if root.tag != "COLLADA":
        raise ValueError(f"its root is <{root.tag[:60]}>, not <COLLADA>")
    document = _Document(root)
    instance = root.find("scene/instance_visual_scene")
    scene = None if instance is None else document.target(instance)
    if scene is None:
        raise ValueError("has no scene")
    if document.weight(scene, {}) > MOST_WEIGHT:
        raise ValueError("places its geometries too often")
    parts: list[Part] = []
    to_metres = np.diag([*[_metres(root)] * 3, 1.0])
    for node in scene.findall("node"):
        parts += document.placed(node, to_metres, "")
        check_count(sum(len(part.faces) for part in parts))
    return parts


def _metres(root: Element) -> float:
    """The length of the file's unit, 1 m if it makes no sense."""
    unit = root.find("asset/unit")
    try:
        metres = float("1" if unit is None else unit.get("meter", "1"))
    except ValueError:
        return 1.0
    if math.isfinite(metres) and metres > 0:
        return metres
    return 1.0


@dataclass
class _Document:
    """Looks up elements by tag and id. Each geometry, and each list of positions, is read once."""

    root: Element
    known: dict[tuple[str, str], Element] = field(default_factory=dict)
    geometries: dict[Element, list[Part]] = field(default_factory=dict)
    positions: dict[Element, np.ndarray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        for element in self.root.iter():
            self.known.setdefault((element.tag, element.get("id", "")), element)

    def named(self, tag: str, url: str | None) -> Element | None:
        """The element `tag` that `url` names in this file; other files are not opened."""
        return (
            self.known.get((tag, url[1:])) if url and url.startswith("#") and url != "#" else None
        )

    def target(self, instance: Element) -> Element | None:
        """The element that an instance places. Skinned shapes keep their original pose."""
        target = self.named(TARGETS.get(instance.tag, ""), instance.get("url"))
        if target is None or target.tag != "controller":
            return target
        skin = target.find("skin")
        if skin is None:
            return None
        return self.named("geometry", skin.get("source"))

    def weight(self, element: Element, weights: dict[Element, int]) -> int:
        """The approximate bytes of `element` with everything it places. Raises RecursionError if it
        contains itself.
        """
        if element not in weights:
            target = self.target(element)
            parts = [*element, *([] if target is None else [target])]
            weights[element] = (
                1000 + len(element.text or "") + sum(self.weight(each, weights) for each in parts)
            )
        return weights[element]

    def placed(self, node: Element, outer: np.ndarray, name: str) -> Iterator[Part]:
        """Everything that `node` places; `outer` (4, 4) is its parent's transform into m, `name`
        its parent's name.
        """
        name = node.get("name") or name
        transform = outer
        for child in node:
            transform = transform @ _transform(child)
        for child in node:
            target = child if child.tag == "node" else self.target(child)
            if target is None:
                continue
            if target.tag == "node":
                yield from self.placed(target, transform, name)
            elif target.tag == "geometry":
                names = (name, target.get("name", ""), target.get("id", ""), node.get("id", ""))
                yield from (_moved(part, transform, names) for part in self.parts_of(target))

    def parts_of(self, geometry: Element) -> list[Part]:
        """The primitives of a geometry that have faces, in the file's unit and without names.
        Raises ValueError.
        """
        if geometry not in self.geometries:
            parts = self.geometries[geometry] = []
            for primitive in (
                each for mesh in geometry.findall("mesh") for each in mesh if each.tag in PRIMITIVES
            ):
                corners, counts = _polygons(primitive)
                faces = _triangles(counts, strips=primitive.tag == "tristrips")
                if len(faces):
                    parts.append(used_part((), self.positions_of(primitive), corners[faces]))
        return self.geometries[geometry]

    def positions_of(self, primitive: Element) -> np.ndarray:
        """The positions (N, 3) that the indices of `primitive` name. Raises ValueError."""
        vertex = _vertex_input(primitive)
        vertices = self.named("vertices", vertex.get("source"))
        position = None if vertices is None else vertices.find("input[@semantic='POSITION']")
        source = None if position is None else self.named("source", position.get("source"))
        if source is None:
            raise ValueError(f"<{primitive.tag}> has no vertices")
        if any(
            (each.get("stride", "3"), each.get("offset", "0")) != ("3", "0")
            for each in source.iter("accessor")
        ):
            raise ValueError("its positions are stored with gaps; save it without them")
        if source not in self.positions:
            values = _numbers(source.find("float_array"))
            self.positions[source] = values[: len(values) // 3 * 3].reshape(-1, 3)
        return self.positions[source]


def _vertex_input(primitive: Element) -> Element:
    found = primitive.find("input[@semantic='VERTEX']")
    if found is None:
        raise ValueError(f"<{primitive.tag}> has no vertices")
    return found


def _polygons(primitive: Element) -> tuple[np.ndarray, np.ndarray]:
    """The vertex indices of a primitive, one polygon, fan or strip after the other, and how many
    each has. Raises ValueError.

    Holes of polygons are dropped.
    """
    paths = [_numbers(path, int) for path in (*primitive.findall("p"), *primitive.findall("ph/p"))]
    offsets = [int(each.get("offset", "0")) for each in primitive.findall("input")]
    if not any(map(len, paths)):
        return np.zeros(0, dtype=int), np.zeros(0, dtype=int)
    own = int(_vertex_input(primitive).get("offset", "0"))
    width = max(offsets) + 1
    if min(offsets) < 0 or any(len(path) % width for path in paths):
        raise ValueError(f"<p> of <{primitive.tag}> does not match its inputs")
    corners = np.concatenate(paths).reshape(-1, width)[:, own]
    if primitive.tag == "triangles":
        counts = np.full(len(corners) // 3, 3)
    elif primitive.tag == "polylist":
        counts = _numbers(primitive.find("vcount"), int)
    else:
        counts = np.array([len(path) // width for path in paths])
    # Sums of huge numbers would overflow.
    if len(counts) and (
        counts.min() < 0 or counts.max() > len(corners) or counts.sum() > len(corners)
    ):
        raise ValueError("<vcount> does not match <p>")
    return corners, counts


def _triangles(counts: np.ndarray, *, strips: bool) -> np.ndarray:
    """The triangles (M, 3) of polygons, or of strips, of so many corners that follow each other, by
    the places of these corners.
    """
    per_polygon = np.maximum(counts - 2, 0)
    first = np.repeat(np.cumsum(counts) - counts, per_polygon)
    step = np.arange(len(first)) - np.repeat(np.cumsum(per_polygon) - per_polygon, per_polygon)
    if not strips:
        return np.stack([first, first + step + 1, first + step + 2], axis=1)
    # Every second triangle of a strip has its corners the other way round.
    turned = step % 2
    return np.stack([first + step, first + step + 1 + turned, first + step + 2 - turned], axis=1)


def _transform(element: Element) -> np.ndarray:
    """The matrix (4, 4) of a child of a node; the identity if it is no transform. Raises
    ValueError.
    """
    matrix = np.eye(4)
    if element.tag == "matrix":
        matrix = _numbers(element).reshape(4, 4)
    elif element.tag == "translate":
        matrix[:3, 3] = _numbers(element)
    elif element.tag == "scale":
        matrix[[0, 1, 2], [0, 1, 2]] = _numbers(element)
    elif element.tag == "rotate":
        x, y, z, degrees = _numbers(element)
        matrix[:3, :3] = _rotation(x, y, z, math.radians(degrees % 360))
    return matrix


def _rotation(x: float, y: float, z: float, angle: float) -> np.ndarray:
    """The matrix (3, 3) that turns by `angle` rad about an axis of any length; one of length zero
    turns nothing.
    """
    length = math.hypot(x, y, z)
    if length == 0:
        return np.eye(3)
    x = x / length
    y = y / length
    z = z / length
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    # Rodrigues' formula.
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1 - math.cos(angle)) * (cross @ cross))


def _moved(part: Part, transform: np.ndarray, names: tuple[str, ...]) -> Part:
    vertices = part.vertices @ transform[:3, :3].T + transform[:3, 3]
    # In a mirror image corners go the other way round.
    is_mirrored = np.linalg.det(transform[:3, :3]) < 0
    return Part(names, vertices, part.faces[:, ::-1] if is_mirrored else part.faces)


def _numbers(element: Element | None, kind: type = float) -> np.ndarray:
    """All numbers in the text of `element`. Raises ValueError for any other word."""
    text = "" if element is None else element.text or ""
    return np.array(text.split(), dtype=kind)
