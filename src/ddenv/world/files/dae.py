"""Reads COLLADA (.dae) files with trimesh and pycollada, in the frame in which Gazebo shows them.

As in Gazebo's loader, `<unit>` scales the mesh and `<up_axis>` is ignored: worlds pose their models for Gazebo's view, and
exporters wrote any up axis. trimesh applies neither and forgets the names of nodes, so each instance gets its own numbered
geometry. Materials, lights, animations and skeletons are removed, so that errors in them do no harm.
"""

from __future__ import annotations

import math
from io import BytesIO
from xml.etree.ElementTree import Element, SubElement, tostring

from ddenv.world.access import Unusable, xml_root
from ddenv.world.files.triangles import Part, parts_of

PRIMITIVES = ("triangles", "polylist", "polygons", "tristrips", "trifans")
TRANSFORMS = ("matrix", "translate", "scale")
INSTANCES = ("instance_visual_scene", "instance_node", "instance_geometry", "instance_controller")
# Maximum size of the expanded scene, bytes: a few lines can place one geometry a million times.
MOST_WEIGHT = 400_000_000


def read_dae(data: bytes) -> list[Part]:
    """Every instance of every geometry in the scene, in m, named by its node, its geometry and their ids.

    Dangling references are skipped, as in Gazebo. Raises what pycollada raises, and ValueError.
    """
    import trimesh
    from trimesh.exchange.dae import load_collada

    try:
        root = xml_root(data)
    except Unusable as error:
        raise ValueError(str(error)) from None
    if root.tag != "COLLADA":
        raise ValueError(f"its root is <{root.tag[:60]}>, not <COLLADA>")
    known = {id: element for element in root.iter() if (id := element.get("id"))}
    instance = root.find("scene/instance_visual_scene")
    scene = None if instance is None else _target(instance, known)
    if scene is None:
        raise ValueError("has no scene")
    if _weight(scene, known, {}) > MOST_WEIGHT:
        raise ValueError("places its geometries too often")
    for geometry in root.iter("geometry"):
        _repair(geometry, known)
    places: list[tuple[tuple[str, ...], Element]] = []
    nodes = [_placed(node, "", known, places) for node in scene.iterfind("node")]
    # With `ignore_broken`, unsupported geometry would be dropped silently.
    loaded = load_collada(  # type: ignore[no-untyped-call]  # trimesh
        BytesIO(_document(nodes, [geometry for _, geometry in places])), ignore_broken=False
    )
    unit, meshes = root.find("asset/unit"), []
    try:
        metres = float("1" if unit is None else unit.get("meter", "1"))
    except ValueError:
        metres = 1.0
    for place in loaded["graph"]:
        shape = loaded["geometry"][place["geometry"]]
        mesh = trimesh.Trimesh(shape["vertices"], shape["faces"], process=False)
        mesh.apply_transform(place["matrix"])
        mesh.apply_scale(metres if math.isfinite(metres) and metres > 0 else 1.0)  # type: ignore[no-untyped-call]  # trimesh
        meshes.append((places[int(place["geometry"].partition("_")[0])][0], mesh))
    return parts_of(meshes)


def _repair(geometry: Element, known: dict[str, Element]) -> None:
    """Removes everything without faces; repairs what pycollada would misread. Raises ValueError for what it cannot repair."""
    for place in geometry.iterfind("mesh/vertices/input[@semantic='POSITION']"):
        source = known.get(place.get("source", "")[1:], Element("source"))
        # pycollada reads NaN as zero, and ignores gaps.
        if "nan" in source.findtext("float_array", "").lower():
            raise ValueError("has vertices that are not finite")
        if any((each.get("stride", "3"), each.get("offset", "0")) != ("3", "0") for each in source.iter("accessor")):
            raise ValueError("its positions are stored with gaps; save it without them")
    for mesh in geometry.iterfind("mesh"):
        for element in list(mesh):
            if element.tag in PRIMITIVES:
                _repair_faces(element)
            empty = element.tag not in PRIMITIVES or element.find("p") is None
            if empty and element.tag not in ("source", "vertices"):
                mesh.remove(element)


def _repair_faces(element: Element) -> None:
    """The same for one primitive; holes of polygons are dropped. Raises ValueError."""
    paths = [path for path in (*element.iterfind("p"), *element.iterfind("ph/p")) if (path.text or "").strip()]
    texts = [path.text or "" for path in paths]
    if any("-" in text for text in texts):
        raise ValueError("a face has a negative index")
    if element.tag == "triangles" and paths:
        # pycollada reads only the first.
        paths[0].text = " ".join(texts)
        del paths[1:]
    counts = [int(word) for word in element.findtext("vcount", "").split()]
    # pycollada would allocate arrays of any size given here.
    if counts and (min(counts) < 0 or sum(counts) > sum(map(len, texts))):
        raise ValueError("<vcount> does not match <p>")
    for each in element.findall("input"):
        if each.get("semantic") != "VERTEX":
            # Normals, textures and colours keep their place in the index list, as the one kind that pycollada does not check.
            each.set("semantic", "TANGENT")
        if int(each.get("offset", 0)) < 0:
            raise ValueError(f"<{element.tag}> has no vertices")
    element[:] = [each for each in element if each.tag in ("input", "vcount")] + paths


def _placed(
    node: Element, name: str, known: dict[str, Element], places: list[tuple[tuple[str, ...], Element]]
) -> Element:
    """A copy of `node` with its transforms and everything it places; appends names and geometries to `places`.

    A node without a name takes its parent's. Raises RecursionError if a node contains itself.
    """
    name = node.get("name") or name
    copy = Element("node")
    for each in node:
        target = each if each.tag == "node" else _target(each, known)
        if each.tag == "rotate":
            # About a unit axis, as pycollada needs it; an axis of length zero turns nothing.
            *axis, angle = (float(word) for word in (each.text or "").split())
            length = math.hypot(*axis)
            values = [*(value / length for value in axis), angle % 360] if length else [0.0] * 4
            SubElement(copy, "rotate").text = " ".join(map(repr, values))
        elif each.tag in TRANSFORMS:
            copy.append(each)
        elif target is not None and target.tag == "node":
            copy.append(_placed(target, name, known, places))
        elif target is not None and target.tag == "geometry":
            SubElement(copy, "instance_geometry", url=f"#{len(places)}")
            places.append(((name, target.get("name", ""), target.get("id", ""), node.get("id", "")), target))
    return copy


def _target(instance: Element, known: dict[str, Element]) -> Element | None:
    """The element that an instance places; other files are not opened. Skinned shapes keep their original pose."""
    target = known.get(instance.get("url", "")[1:]) if instance.tag in INSTANCES else None
    if target is not None and target.tag == "controller":
        return known.get("".join(skin.get("source", "")[1:] for skin in target.iterfind("skin")))
    return target


def _weight(element: Element, known: dict[str, Element], weights: dict[Element, int]) -> int:
    """The approximate bytes of `element` with everything it places. Raises RecursionError if it contains itself."""
    if element not in weights:
        target = _target(element, known)
        parts = [*element, *([] if target is None else [target])]
        weights[element] = 1000 + len(element.text or "") + sum(_weight(each, known, weights) for each in parts)
    return weights[element]


def _document(nodes: list[Element], geometries: list[Element]) -> bytes:
    """A file that places each geometry once; a geometry's id is its number."""
    root = Element("COLLADA", xmlns="http://www.collada.org/2005/11/COLLADASchema", version="1.4.1")
    library = SubElement(root, "library_geometries")
    for number, geometry in enumerate(geometries):
        SubElement(library, "geometry", id=str(number)).extend(geometry.findall("mesh"))
    SubElement(SubElement(root, "library_visual_scenes"), "visual_scene", id="scene").extend(nodes)
    SubElement(SubElement(root, "scene"), "instance_visual_scene", url="#scene")
    return tostring(root)
