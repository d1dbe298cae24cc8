"""Reads an SDF world or model file into plain data (`ddenv.world.model`).

We read SDF ourselves because Drake's parser refuses many files that simulators accept, and drops parts of others without
a word. What this reader does not understand it refuses with the file, the line and the XPath: it never guesses.
"""

from __future__ import annotations

import math
from pathlib import Path

from ddenv.errors import UserError
from ddenv.world.sdf.geometry import read_color, read_friction, read_inertia, read_shape
from ddenv.world.model import Collision, Joint, Link, Model, Visual, World
from ddenv.world.pose import Pose
from ddenv.world.sdf.xml import Element, complain, number, numbers, parse, truth

MAX_BYTES = 200_000_000
GRAVITY = (0.0, 0.0, -9.81)
JOINT_KINDS = ("fixed", "revolute", "continuous")
# An unlimited value is written by simulators as a huge number or as -1; SDF's own default for both limits is infinite.
UNLIMITED = 1e15


def read_world(path: Path) -> World:
    """The world in the SDF file `path`. Raises UserError with file, line and XPath."""
    return parse_world(read_bytes(path), path)


def parse_world(text: bytes, path: Path) -> World:
    """The world in `text`; `path` is only named in complaints."""
    worlds = _root(text, path).findall("world")
    if len(worlds) != 1:
        found = "no <world>" if not worlds else f"{len(worlds)} <world> elements"
        raise UserError(f"{path}: expected one <world> inside <sdf>, found {found}")
    world = worlds[0]
    for tag in ("include", "state", "frame"):
        unsupported = world.find(tag)
        if unsupported is not None:
            raise complain(unsupported, path, f"<{tag}> is not supported in a world yet; save the world without it")
    models = tuple(_model(element, path) for element in world.findall("model"))
    _unique(world.findall("model"), path)
    gravity = world.find("gravity")
    return World(
        path=path,
        name=world.get("name") or "",
        text=text,
        gravity=GRAVITY if gravity is None else numbers(gravity, path, 3),
        models=models,
    )


def read_model(path: Path) -> Model:
    """The one model in the SDF file `path`, such as a robot. Raises UserError."""
    return parse_model(read_bytes(path), path)


def parse_model(text: bytes, path: Path) -> Model:
    """The one model in `text`; `path` is only named in complaints."""
    models = _root(text, path).findall("model")
    if len(models) != 1:
        raise UserError(f"{path}: expected one <model> inside <sdf>, found {len(models)}")
    return _model(models[0], path)


def read_bytes(path: Path) -> bytes:
    """The whole file. Raises UserError for a file that is missing, unreadable or far too large."""
    try:
        if path.is_dir():
            raise UserError(f"{path}: is a folder; expected an SDF file")
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise UserError(f"{path}: {size / 1e6:.0f} MB is too large; at most {MAX_BYTES / 1e6:.0f} MB are read")
        return path.read_bytes()
    except FileNotFoundError:
        raise UserError(f"{path}: no such file") from None
    except ValueError:
        raise UserError(f"{path}: cannot be a file's name") from None
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from None


def _root(text: bytes, path: Path) -> Element:
    root = parse(text, path)
    if root.tag != "sdf":
        raise complain(root, path, "expected <sdf> as the outermost element: is this an SDF file?")
    return root


def _unique(elements: list[Element], path: Path) -> None:
    seen: set[str] = set()
    for element in elements:
        name = element.get("name", "")
        if name in seen:
            raise complain(element, path, "this name stands twice; every model needs a name of its own")
        seen.add(name)


def _name(element: Element, path: Path) -> str:
    name = element.get("name")
    if not name:
        raise complain(element, path, "has no name attribute")
    return name


def _pose(parent: Element, path: Path) -> Pose:
    element = parent.find("pose")
    if element is None or not (element.text or "").strip():
        return Pose()
    frame = element.get("relative_to") or element.get("frame")
    if frame:
        raise complain(
            element, path, f"a pose relative to '{frame}' is not supported yet; give it relative to its parent"
        )
    return Pose.from_rpy(*numbers(element, path, 6))


def _model(element: Element, path: Path) -> Model:
    name = _name(element, path)
    for tag in ("model", "include", "frame"):
        unsupported = element.find(tag)
        if unsupported is not None:
            raise complain(unsupported, path, f"<{tag}> inside a model is not supported yet; flatten the model")
    pose = _pose(element, path)
    links = tuple(_link(link, pose, path) for link in element.findall("link"))
    if not links:
        raise complain(element, path, "has no <link>")
    _unique(element.findall("link"), path)
    joints = tuple(_joint(joint, pose, links, path) for joint in element.findall("joint"))
    static = truth(element, "static", path, False)
    return Model(name, pose, static, links, joints, ((element.start, element.end),), element.line)


def _link(element: Element, model_pose: Pose, path: Path) -> Link:
    pose = model_pose @ _pose(element, path)
    collisions = tuple(
        Collision(_name(child, path), read_shape(child, path), pose @ _pose(child, path), read_friction(child, path))
        for child in element.findall("collision")
    )
    visuals = tuple(
        Visual(_name(child, path), read_shape(child, path), pose @ _pose(child, path), read_color(child, path))
        for child in element.findall("visual")
    )
    return Link(_name(element, path), pose, read_inertia(element, pose, path), collisions, visuals)


def _joint(element: Element, model_pose: Pose, links: tuple[Link, ...], path: Path) -> Joint:
    kind = element.get("type", "")
    if kind not in JOINT_KINDS:
        raise complain(element, path, f"joint type '{kind}' is not supported yet; use one of {', '.join(JOINT_KINDS)}")
    by_name = {link.name: link for link in links}
    ends = {}
    for tag in ("parent", "child"):
        end = element.find(tag)
        name = "" if end is None else (end.text or "").strip()
        if name not in by_name and not (tag == "parent" and name == "world"):
            raise complain(element, path, f"<{tag}> names no link of this model: '{name}'")
        ends[tag] = name
    pose = by_name[ends["child"]].pose @ _pose(element, path)
    axis = element.find("axis")
    limit = None if axis is None else axis.find("limit")
    dynamics = None if axis is None else axis.find("dynamics")
    return Joint(
        name=_name(element, path),
        kind=kind,
        parent=ends["parent"],
        child=ends["child"],
        pose=pose,
        axis=_axis(axis, pose, path),
        lower=-math.inf if limit is None else _bound(number(limit, "lower", path, -UNLIMITED)),
        upper=math.inf if limit is None else _bound(number(limit, "upper", path, UNLIMITED)),
        effort=_limit(limit, "effort", path),
        velocity=_limit(limit, "velocity", path),
        damping=0.0 if dynamics is None else number(dynamics, "damping", path, 0.0),
    )


def _axis(axis: Element | None, pose: Pose, path: Path) -> tuple[float, float, float]:
    element = None if axis is None else axis.find("xyz")
    x, y, z = (0.0, 0.0, 1.0) if element is None else numbers(element, path, 3)
    length = math.sqrt(x * x + y * y + z * z)
    if length < 1e-9:
        raise complain(element, path, "a joint's axis needs a length above zero")
    return pose.rotate((x / length, y / length, z / length))


def _bound(value: float) -> float:
    return math.copysign(math.inf, value) if abs(value) >= UNLIMITED else value


def _limit(limit: Element | None, tag: str, path: Path) -> float:
    value = -1.0 if limit is None else number(limit, tag, path, -1.0)
    return math.inf if value < 0 or value >= UNLIMITED else value
