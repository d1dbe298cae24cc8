"""Writes worlds as SDF: the original text without some models (`without`), or clean SDF 1.9 for Drake's parser (`convert`).

Clean SDF holds exactly what the reader understood: poses after `<state>`, resolved frames, included and nested models
written out, unique names, convex hulls of meshes in files of their own, and a large box for an infinite plane, since Drake
crashes with half spaces on the welded bodies that its parser makes of static models (drake#19263).
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable
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
    Inertia,
    Joint,
    Link,
    Mesh,
    Model,
    Plane,
    Shape,
    Sphere,
    Visual,
    World,
)
from ddenv.world.pose import Pose

DRAKE = "http://drake.mit.edu"
_LINE_START = re.compile(rb"(\r\n|\n|\r)[ \t]*\Z")
RESERVED = ("world", "WorldModelInstance", "DefaultModelInstance")


def without(world: World, removed: frozenset[str]) -> bytes:
    """The text of `world` without the models named in `removed` and their indentation; all other bytes stay. Raises ValueError."""
    unknown = removed - {model.name for model in world.models}
    if unknown:
        raise ValueError(f"no such model: {sorted(unknown)[0]}")
    spans = [(*span, b"") for model in world.models if model.name in removed for span in model.spans]
    spans += [(*one.span, one.instead) for one in world.shared if one.models <= removed]
    kept, at = [], 0
    for start, end, instead in sorted(spans, key=lambda each: (each[0], -each[1])):
        # One may lie in another, and two models may share one.
        if start < at:
            continue
        before, ends_line = world.text[at:start], world.text[end : end + 1] in (b"\n", b"\r", b"")
        kept += [_LINE_START.sub(b"", before) if ends_line else before, instead]
        at = end
    kept.append(world.text[at:])
    return b"".join(kept)


# Gives a mesh the relative path of its file.
Files = Callable[[Mesh], str]


def convert(world: World, mesh_folder: str) -> tuple[bytes, dict[str, Mesh]]:
    """`world` as SDF 1.9, and its meshes by the relative paths of their OBJ files, which lie in the folder `mesh_folder`."""
    names: dict[Mesh, str] = {}

    def file(mesh: Mesh) -> str:
        return names.setdefault(mesh, f"{mesh_folder}/mesh_{len(names) + 1}.obj")

    ElementTree.register_namespace("drake", DRAKE)
    root = Element("sdf", version="1.9")
    inside = SubElement(root, "world", name=_clean(world.name) or "world")
    SubElement(inside, "gravity").text = _numbers(world.gravity)
    unique = _unique(model.name for model in world.models)
    for name, model in zip(unique, with_ground_boxes(world, corners(world)).models, strict=True):
        _model(inside, name, model, file)
    ElementTree.indent(root)
    text = ElementTree.tostring(root, encoding="utf-8", xml_declaration=True) + b"\n"
    return text, {name: mesh for mesh, name in names.items()}


def write_converted(world: World, path: Path) -> list[Path]:
    """Writes `world` as clean SDF to `path`, its meshes to a folder beside it; returns the written files. Raises UserError."""
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


def _model(parent: Element, name: str, model: Model, file: Files) -> None:
    element = SubElement(parent, "model", name=name)
    if model.static:
        SubElement(element, "static").text = "true"
    if model.self_collide:
        SubElement(element, "self_collide").text = "true"
    _pose(element, model.pose)
    names = dict(zip((link.name for link in model.links), _unique(link.name for link in model.links), strict=True))
    for link in model.links:
        _link(element, names[link.name], link, model, file)
    joint_names = _unique((joint.name for joint in model.joints), taken=names.values())
    poses = {link.name: link.pose for link in model.links}
    for joint_name, joint in zip(joint_names, model.joints, strict=True):
        _joint(element, joint_name, joint, model, poses[joint.child], names)


def _link(parent: Element, name: str, link: Link, model: Model, file: Files) -> None:
    element = SubElement(parent, "link", name=name)
    _pose(element, model.pose.inverse() @ link.pose)
    if not model.gravity:
        SubElement(element, "gravity").text = "false"
    if link.inertia is not None:
        _inertia(element, link.inertia, link.pose)
    back = link.pose.inverse()
    shown: tuple[Collision | Visual, ...] = (*link.collisions, *link.visuals)
    for one, own in zip(shown, _unique(one.name for one in shown), strict=True):
        _shown(element, own, one, back, file)


def _shown(parent: Element, name: str, one: Collision | Visual, back: Pose, file: Files) -> None:
    element = SubElement(parent, "collision" if isinstance(one, Collision) else "visual", name=name)
    _pose(element, back @ one.pose)
    _geometry(element, one.shape, file)
    if isinstance(one, Collision):
        friction = SubElement(SubElement(SubElement(element, "surface"), "friction"), "ode")
        for tag in ("mu", "mu2"):
            SubElement(friction, tag).text = repr(one.mu)
    elif one.color is not None:
        material = SubElement(element, "material")
        for tag in ("ambient", "diffuse"):
            SubElement(material, tag).text = _numbers(one.color)


def _geometry(parent: Element, shape: Shape, file: Files) -> None:
    geometry = SubElement(parent, "geometry")
    if not isinstance(shape, Mesh):
        kind, sizes = primitive(shape)
        element = SubElement(geometry, kind)
        for name, values in sizes.items():
            SubElement(element, name).text = _numbers(values)
        return
    element = SubElement(geometry, "mesh")
    SubElement(element, "uri").text = file(shape)
    if parent.tag == "collision":
        SubElement(element, f"{{{DRAKE}}}declare_convex")


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


def _inertia(parent: Element, inertia: Inertia, link_pose: Pose) -> None:
    element = SubElement(parent, "inertial")
    _pose(element, link_pose.inverse() @ inertia.pose)
    SubElement(element, "mass").text = repr(inertia.mass)
    tensor = SubElement(element, "inertia")
    names = ("ixx", "iyy", "izz", "ixy", "ixz", "iyz")
    for name, value in zip(names, (*inertia.moments, *inertia.products), strict=True):
        SubElement(tensor, name).text = repr(value)


def _joint(parent: Element, name: str, joint: Joint, model: Model, child_pose: Pose, names: dict[str, str]) -> None:
    element = SubElement(parent, "joint", name=name, type=joint.kind)
    _pose(element, child_pose.inverse() @ joint.pose)
    SubElement(element, "parent").text = names.get(joint.parent, joint.parent)
    SubElement(element, "child").text = names[joint.child]
    if joint.kind in ("fixed", "ball"):
        return
    for tag, axis in (("axis", joint.axis), ("axis2", joint.axis2)):
        if axis is not None:
            holder = SubElement(element, tag)
            SubElement(holder, "xyz").text = _numbers(joint.pose.inverse().rotate(axis))
            _limits(holder, joint)


def _limits(holder: Element, joint: Joint) -> None:
    limits = {"lower": joint.lower, "upper": joint.upper, "effort": joint.effort, "velocity": joint.velocity}
    finite = {tag: value for tag, value in limits.items() if math.isfinite(value)}
    if finite:
        limit = SubElement(holder, "limit")
        for tag, value in finite.items():
            SubElement(limit, tag).text = repr(value)
    if joint.damping:
        SubElement(SubElement(holder, "dynamics"), "damping").text = repr(joint.damping)


def _pose(parent: Element, pose: Pose) -> None:
    """Nothing for the identity; roll, pitch and yaw if only yaw turns, for readers; else a quaternion, which is exact."""
    w, x, y, z = pose.quaternion
    if x == 0.0 and y == 0.0:
        angles = (0.0, 0.0, pose.yaw())
        if any(pose.position) or angles[2]:
            SubElement(parent, "pose").text = _numbers((*pose.position, *angles))
        return
    SubElement(parent, "pose", rotation_format="quat_xyzw").text = _numbers((*pose.position, x, y, z, w))


def _numbers(values: Iterable[float]) -> str:
    # Adding zero turns -0 into 0.
    return " ".join(f"{value + 0.0:.12g}" for value in values)


def _clean(name: str) -> str:
    """`name` without characters and words that SDF reserves."""
    name = "".join(char if char.isprintable() else "_" for char in name).replace("::", "_")
    reserved = name in RESERVED or (name.startswith("__") and name.endswith("__"))
    return f"{name.strip('_') or 'a'}_" if reserved else name


def _unique(names: Iterable[str], taken: Iterable[str] = ()) -> list[str]:
    """Clean, unique names; repeated ones get a number."""
    used, unique = set(taken), []
    for name in map(_clean, names):
        own, number = name, 1
        while own in used:
            number += 1
            own = f"{name}_{number}"
        used.add(own)
        unique.append(own)
    return unique


def obj(mesh: Mesh) -> bytes:
    """A mesh as an OBJ file."""
    points = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in np.asarray(mesh.vertices, dtype=float)]
    faces = [f"f {a} {b} {c}" for a, b, c in np.asarray(mesh.faces, dtype=int) + 1]
    return "\n".join([*points, *faces, ""]).encode()
