"""Writes worlds as SDF: the original text without some models (`without`), or clean SDF 1.9 for
Drake's parser (`convert`).

Clean SDF holds exactly what the reader understood: poses after `<state>`, resolved frames, included
and nested models written out, unique names, convex hulls of meshes in files of their own, and a
large box for an infinite plane, since Drake crashes with half spaces on the welded bodies that its
parser makes of static models (drake#19263).
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Mapping
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from ddenv.errors import UserError
from ddenv.world.access import write_file
from ddenv.world.extent import corners, with_ground_boxes
from ddenv.world.model import (
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Joint,
    Link,
    Mesh,
    Model,
    Plane,
    Shape,
    Sphere,
    Terrain,
    Visual,
    World,
    unique_names,
)
from ddenv.world.pose import Pose, Vector
from ddenv.world.terrain import surface

DRAKE = "http://drake.mit.edu"
_LINE_START = re.compile(rb"(\r\n|\n|\r)[ \t]*\Z")
RESERVED = ("world", "WorldModelInstance", "DefaultModelInstance")


def without(world: World, removed: frozenset[str]) -> bytes:
    """The text of `world` without the models named in `removed` and their indentation; all other
    bytes stay. Raises ValueError.
    """
    unknown = removed.difference(world.names)
    if unknown:
        raise ValueError(f"no such model: {sorted(unknown)[0]}")
    spans = [
        (*span, b"") for model in world.models if model.name in removed for span in model.spans
    ]
    spans += [(*one.span, one.instead) for one in world.shared if one.models <= removed]
    kept = []
    at = 0
    for start, end, instead in sorted(spans, key=lambda each: (each[0], -each[1])):
        # One may lie in another, and two models may share one.
        if start < at:
            continue
        before = world.text[at:start]
        ends_line = world.text[end : end + 1] in (b"\n", b"\r", b"")
        kept += [_LINE_START.sub(b"", before) if ends_line else before, instead]
        at = end
    kept.append(world.text[at:])
    return b"".join(kept)


def convert(world: World, mesh_folder: str) -> tuple[bytes, dict[str, Mesh]]:
    """`world` as SDF 1.9, and its meshes by the relative paths of their OBJ files, which lie in the
    folder `mesh_folder`.
    """
    files: dict[Mesh, str] = {}
    for link in (link for model in world.models for link in model.links):
        for shape in (
            *(one.shape for one in link.collisions),
            *(one.shape for one in link.visuals),
        ):
            shape = as_mesh(shape)
            if isinstance(shape, Mesh):
                files.setdefault(shape, f"{mesh_folder}/mesh_{len(files) + 1}.obj")
    ElementTree.register_namespace("drake", DRAKE)
    root = Element("sdf", version="1.9")
    inside = SubElement(root, "world", name=_clean(world.name) or "world")
    SubElement(inside, "gravity").text = _numbers(world.gravity)
    unique = _unique(world.names)
    for name, model in zip(unique, with_ground_boxes(world, corners(world)).models, strict=True):
        _model(SubElement(inside, "model", name=name), model, files)
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"
    return text, {name: mesh for mesh, name in files.items()}


def write_converted(world: World, path: Path) -> list[Path]:
    """Writes `world` as clean SDF to `path`, its meshes to a folder beside it; returns the written
    files. Raises UserError.
    """
    if path.resolve() == world.path.resolve():
        raise UserError(f"{path}: is the world itself; choose another file")
    folder = path.with_name(f"{path.stem}_meshes")
    text, meshes = convert(world, folder.name)
    if meshes:
        try:
            folder.mkdir(exist_ok=True)
        except OSError as error:
            raise UserError(f"{folder}: cannot be created: {error.strerror}") from None
    files = {path.parent / name: obj(mesh) for name, mesh in meshes.items()} | {path: text}
    for file, content in files.items():
        write_file(file, content)
    return list(files)


def _model(element: Element, model: Model, files: Mapping[Mesh, str]) -> None:
    for tag, said in (("static", model.static), ("self_collide", model.self_collide)):
        if said:
            SubElement(element, tag).text = "true"
    _pose(element, model.pose)
    names = dict(
        zip(
            (link.name for link in model.links),
            _unique(link.name for link in model.links),
            strict=True,
        )
    )
    for link in model.links:
        _link(SubElement(element, "link", name=names[link.name]), link, model, files)
    joint_names = _unique((joint.name for joint in model.joints), taken=names.values())
    poses = {link.name: link.pose for link in model.links}
    for joint_name, joint in zip(joint_names, model.joints, strict=True):
        held = SubElement(element, "joint", name=joint_name, type=joint.kind)
        _pose(held, poses[joint.child].inverse() @ joint.pose)
        SubElement(held, "parent").text = names.get(joint.parent, joint.parent)
        SubElement(held, "child").text = names[joint.child]
        for tag, axis in (("axis", joint.axis), ("axis2", joint.axis2)):
            if axis is not None and joint.kind not in ("fixed", "ball"):
                _axis(SubElement(held, tag), axis, joint)


def _link(element: Element, link: Link, model: Model, files: Mapping[Mesh, str]) -> None:
    back = link.pose.inverse()
    _pose(element, model.pose.inverse() @ link.pose)
    if not model.gravity:
        SubElement(element, "gravity").text = "false"
    if link.inertia is not None:
        inertial = SubElement(element, "inertial")
        _pose(inertial, back @ link.inertia.pose)
        SubElement(inertial, "mass").text = repr(link.inertia.mass)
        tensor = SubElement(inertial, "inertia")
        values = (*link.inertia.moments, *link.inertia.products)
        for tag, value in zip(("ixx", "iyy", "izz", "ixy", "ixz", "iyz"), values, strict=True):
            SubElement(tensor, tag).text = repr(value)
    shown: tuple[Collision | Visual, ...] = (*link.collisions, *link.visuals)
    for one, own in zip(shown, _unique(one.name for one in shown), strict=True):
        _shown(element, own, one, back, files)


def _shown(
    parent: Element, name: str, one: Collision | Visual, back: Pose, files: Mapping[Mesh, str]
) -> None:
    element = SubElement(parent, "collision" if isinstance(one, Collision) else "visual", name=name)
    _pose(element, back @ one.pose)
    geometry = SubElement(element, "geometry")
    mesh_shape = as_mesh(one.shape)
    if isinstance(mesh_shape, Mesh):
        mesh = SubElement(geometry, "mesh")
        SubElement(mesh, "uri").text = files[mesh_shape]
        if isinstance(one, Collision) and isinstance(one.shape, Mesh):
            SubElement(mesh, f"{{{DRAKE}}}declare_convex")
    else:
        kind, sizes = primitive(one.shape)
        shape = SubElement(geometry, kind)
        for tag, values in sizes.items():
            SubElement(shape, tag).text = _numbers(values)
    if isinstance(one, Collision):
        friction = SubElement(SubElement(SubElement(element, "surface"), "friction"), "ode")
        for tag in ("mu", "mu2"):
            SubElement(friction, tag).text = repr(one.mu)
    elif one.color is not None:
        material = SubElement(element, "material")
        for tag in ("ambient", "diffuse"):
            SubElement(material, tag).text = _numbers(one.color)


def as_mesh(shape: Shape) -> Shape:
    """The triangles of terrain; any other shape as it is."""
    if isinstance(shape, Terrain):
        return surface(shape)
    return shape


def _axis(holder: Element, axis: Vector, joint: Joint) -> None:
    SubElement(holder, "xyz").text = _numbers(joint.pose.inverse().rotate(axis))
    limits = {
        "lower": joint.lower,
        "upper": joint.upper,
        "effort": joint.effort,
        "velocity": joint.velocity,
    }
    if any(map(math.isfinite, limits.values())):
        limit = SubElement(holder, "limit")
        for tag, value in limits.items():
            if math.isfinite(value):
                SubElement(limit, tag).text = repr(value)
    if joint.damping:
        SubElement(SubElement(holder, "dynamics"), "damping").text = repr(joint.damping)


def primitive(shape: Shape) -> tuple[str, dict[str, tuple[float, ...]]]:
    """The tag of a shape other than a mesh, with its sizes by tag."""
    match shape:
        case Box(size):
            return "box", {"size": size}
        case Cylinder(radius, length):
            return "cylinder", {"radius": (radius,), "length": (length,)}
        case Capsule(radius, length):
            return "capsule", {"radius": (radius,), "length": (length,)}
        case Sphere(radius):
            return "sphere", {"radius": (radius,)}
        case Ellipsoid(radii):
            return "ellipsoid", {"radii": radii}
        case Plane(size):
            return "plane", {"normal": (0.0, 0.0, 1.0), "size": size}
    raise TypeError(type(shape).__name__)


def _pose(parent: Element, pose: Pose) -> None:
    """Nothing for the identity; roll, pitch and yaw if only yaw turns, for readers; else a
    quaternion, which is exact.
    """
    w, x, y, z = pose.quaternion
    if x == 0.0 and y == 0.0:
        angles = (0.0, 0.0, pose.yaw())
        if any(pose.position) or angles[2]:
            SubElement(parent, "pose").text = _numbers((*pose.position, *angles))
        return
    SubElement(parent, "pose", rotation_format="quat_xyzw").text = _numbers(
        (*pose.position, x, y, z, w)
    )


def _numbers(values: Iterable[float]) -> str:
    # Adding zero turns -0 into 0.
    return " ".join(f"{value + 0.0:.12g}" for value in values)


def _clean(name: str) -> str:
    """`name` without characters and words that SDF reserves."""
    name = "".join(char if char.isprintable() else "_" for char in name).replace("::", "_")
    reserved = name in RESERVED or (name.startswith("__") and name.endswith("__"))
    if reserved:
        return f"{name.strip('_') or 'a'}_"
    return name


def _unique(names: Iterable[str], taken: Collection[str] = ()) -> list[str]:
    return unique_names(list(map(_clean, names)), "_", taken)


def obj(mesh: Mesh) -> bytes:
    """A mesh as an OBJ file."""
    points = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in np.asarray(mesh.vertices, dtype=float)]
    faces = [f"f {a} {b} {c}" for a, b, c in np.asarray(mesh.faces, dtype=int) + 1]
    return "\n".join([*points, *faces, ""]).encode()
