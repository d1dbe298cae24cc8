"""COLLADA (.dae) files through trimesh and pycollada, in the frame in which Gazebo shows them.

As in Gazebo's own loader, `<unit>` scales the mesh and `<up_axis>` changes nothing: models are posed for how Gazebo shows
them, and exporters wrote any up axis. trimesh applies neither, and forgets the names of nodes, so every instance is given a
geometry of its own to be known by. Materials, lights, animations and skeletons are taken out: a mistake there spoils no shape.
"""

from __future__ import annotations

import math
from io import BytesIO
from xml.etree.ElementTree import Element, ParseError, SubElement, tostring

from ddenv.world.files.triangles import Part, parts_of

PRIMITIVES = ("triangles", "polylist", "polygons", "tristrips", "trifans")
TRANSFORMS = ("matrix", "translate", "scale")
INSTANCES = ("instance_visual_scene", "instance_node", "instance_geometry", "instance_controller")
# A few lines can place one geometry a million times.
MOST_WEIGHT = 400_000_000


def read_dae(data: bytes) -> list[Part]:
    """Every instance of every geometry in the scene, in m, named by its node, its geometry, and their ids.

    A reference to what is not there is passed over, as Gazebo does. Raises what pycollada raises, and ValueError.
    """
    import trimesh
    from trimesh.exchange.dae import load_collada

    root = _parse(data)
    known = {element.get("id"): element for element in root.iter() if element.get("id")}
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
    # With `ignore_broken`, geometry that is not understood is left out without a word.
    loaded = load_collada(BytesIO(_document(nodes, [geometry for _, geometry in places])), ignore_broken=False)
    metres, meshes = _metres(root), []
    for place in loaded["graph"]:
        shape = loaded["geometry"][place["geometry"]]
        mesh = trimesh.Trimesh(shape["vertices"], shape["faces"], process=False)
        mesh.apply_transform(place["matrix"]).apply_scale(metres)
        meshes.append((places[int(place["geometry"].partition("_")[0])][0], mesh))
    return parts_of(meshes)


def _parse(data: bytes) -> Element:
    from defusedxml import DefusedXmlException
    from defusedxml.ElementTree import fromstring

    try:
        root = fromstring(data, forbid_dtd=True, forbid_entities=True, forbid_external=True)
    except ParseError as error:
        raise ValueError(f"line {error.position[0]}: not well-formed XML") from None
    except DefusedXmlException:
        raise ValueError("a DOCTYPE is refused (its entities can fill the memory)") from None
    for element in root.iter():
        element.tag = element.tag.rpartition("}")[2]
    if root.tag != "COLLADA":
        raise ValueError(f"its root is <{root.tag[:60]}>, not <COLLADA>")
    return root


def _metres(root: Element) -> float:
    """How many m one unit of the file is; 1 where that is missing or no sensible number."""
    unit = root.find("asset/unit")
    try:
        metres = float("1" if unit is None else unit.get("meter", "1"))
    except ValueError:
        return 1.0
    return metres if math.isfinite(metres) and metres > 0 else 1.0


def _repair(geometry: Element, known: dict[str, Element]) -> None:
    """Leaves only what has faces, and of that refuses or puts straight what pycollada reads wrongly."""
    for place in geometry.iterfind("mesh/vertices/input[@semantic='POSITION']"):
        source = known.get(place.get("source", "")[1:], Element("source"))
        # pycollada makes a zero of what is no number, and knows no gaps.
        if "nan" in source.findtext("float_array", "").lower():
            raise ValueError("has vertices that are no finite numbers")
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
    """The same for one primitive; polygons lose their holes."""
    paths = [path for path in (*element.iterfind("p"), *element.iterfind("ph/p")) if (path.text or "").strip()]
    if any("-" in path.text for path in paths):
        raise ValueError("a face has a number below zero")
    if element.tag == "triangles" and paths:
        # pycollada reads the first alone.
        paths[0].text = " ".join(path.text for path in paths)
        del paths[1:]
    counts = [int(word) for word in element.findtext("vcount", "").split()]
    # pycollada makes arrays of any size that these say.
    if counts and (min(counts) < 0 or sum(counts) > sum(len(path.text) for path in paths)):
        raise ValueError("<vcount> does not match <p>")
    for each in element.findall("input"):
        if each.get("semantic") != "VERTEX":
            # Normals, textures and colors keep their place among the numbers, as the one kind that nothing looks into.
            each.set("semantic", "TANGENT")
        if int(each.get("offset", 0)) < 0:
            raise ValueError(f"<{element.tag}> has no vertices")
    element[:] = [each for each in element if each.tag in ("input", "vcount")] + paths


def _placed(
    node: Element, name: str, known: dict[str, Element], places: list[tuple[tuple[str, ...], Element]]
) -> Element:
    """A copy of `node` with its place and all that it places; adds the names and geometries to `places`.

    A node without a name goes by that of the node around it. Raises RecursionError if it is in itself.
    """
    name = node.get("name") or name
    copy = Element("node")
    for each in node:
        target = each if each.tag == "node" else _target(each, known)
        if each.tag == "rotate":
            copy.append(_rotation(each))
        elif each.tag in TRANSFORMS:
            copy.append(each)
        elif target is not None and target.tag == "node":
            copy.append(_placed(target, name, known, places))
        elif target is not None and target.tag == "geometry":
            SubElement(copy, "instance_geometry", url=f"#{len(places)}")
            places.append(((name, target.get("name", ""), target.get("id", ""), node.get("id", "")), target))
    return copy


def _rotation(element: Element) -> Element:
    """pycollada needs an axis of length one; around none, nothing turns."""
    *axis, angle = (float(word) for word in (element.text or "").split())
    length = math.hypot(*axis)
    values = [*(value / length for value in axis), angle % 360] if length else [0.0] * 4
    copy = Element("rotate")
    copy.text = " ".join(map(repr, values))
    return copy


def _target(instance: Element, known: dict[str, Element]) -> Element | None:
    """What an instance places; other files are not opened. A shape with a skeleton stands as it was drawn."""
    target = known.get(instance.get("url", "")[1:]) if instance.tag in INSTANCES else None
    if target is not None and target.tag == "controller":
        return known.get("".join(skin.get("source", "")[1:] for skin in target.iterfind("skin")))
    return target


def _weight(element: Element, known: dict[str, Element], weights: dict[Element, int]) -> int:
    """About how many bytes a copy of `element` takes, with all that it places. Raises RecursionError if it is in itself."""
    if element not in weights:
        target = _target(element, known)
        parts = [*element, *([] if target is None else [target])]
        weights[element] = 1000 + len(element.text or "") + sum(_weight(each, known, weights) for each in parts)
    return weights[element]


def _document(nodes: list[Element], geometries: list[Element]) -> bytes:
    """A file in which each geometry is placed once, and called by its number."""
    root = Element("COLLADA", xmlns="http://www.collada.org/2005/11/COLLADASchema", version="1.4.1")
    library = SubElement(root, "library_geometries")
    for number, geometry in enumerate(geometries):
        SubElement(library, "geometry", id=str(number)).extend(geometry.findall("mesh"))
    SubElement(SubElement(root, "library_visual_scenes"), "visual_scene", id="scene").extend(nodes)
    SubElement(SubElement(root, "scene"), "instance_visual_scene", url="#scene")
    return tostring(root)
