"""Reads the `<joint>`s between the links of one model, in the world frame, and finds the links that
they name.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from graphlib import CycleError, TopologicalSorter

from ddenv.world.model import Joint
from ddenv.world.pose import ONE, Pose, Vector
from ddenv.world.sdf.context import Context, note_unread, refuse, version
from ddenv.world.sdf.frames import WORLD, Scope, shown
from ddenv.world.sdf.xml import Element, complain, floats, name_of, number, numbers, text_of, truth

KINDS = ("fixed", "revolute", "continuous", "prismatic", "ball", "universal")
LIMITED = ("revolute", "prismatic")
# Simulators write "unlimited" as a number at least this large, or as -1; SDF's own default is
# infinite.
UNLIMITED = 1e15


@dataclass(frozen=True)
class LinkPose:
    """A link's pose in the world: `nominal` as in its model, `actual` after `<state>`."""

    nominal: Pose
    actual: Pose


@dataclass(frozen=True, kw_only=True)
class Spot:
    """The place of a model or nested model with the frames `scope`: its own frame in the world, as
    in `LinkPose`.

    `prefix` begins the names of its links in the world, `scale` multiplies its sizes. It is
    `static` if it or a model around it is: then its links are fixed to the world.
    """

    scope: Scope
    nominal: Pose
    actual: Pose
    prefix: str = ""
    scale: Vector = ONE
    static: bool = False


def read_joints(spot: Spot, links: dict[str, LinkPose], context: Context) -> list[Joint]:
    """The joints directly inside the model at `spot`; `links` are all those of the outermost one,
    by full name.

    Raises UserError.
    """
    joints = []
    names = set()
    for element in spot.scope.element.findall("joint"):
        note_unread(element, context)
        if name_of(element) in names:
            raise complain(
                element, "this joint name is used twice; give each joint of the model its own name"
            )
        names.add(name_of(element))
        kind = element.get("type", "")
        if kind in KINDS:
            joints.append(_joint(element, kind, spot, links, context))
        elif context.ignores("joint"):
            context.note(
                "ignored",
                element,
                f"a '{kind}' joint is left out by --ignore: its links move freely",
            )
        else:
            raise refuse(
                element,
                "joint",
                f"joint type '{kind[:40]}' is not supported (only {', '.join(KINDS)})",
            )
    return joints


def _joint(
    element: Element, kind: str, spot: Spot, links: dict[str, LinkPose], context: Context
) -> Joint:
    parent, child = (_end(element, tag, spot, links) for tag in ("parent", "child"))
    if parent == child:
        raise complain(element, f"joins '{child}' to itself")
    # By element, not by name: something else in the model may have the same name.
    nominal = spot.nominal @ spot.scope.place(element, text_of(element.find("child")))
    moved = links[child].actual @ links[child].nominal.inverse()
    axis = element.find("axis")
    first = _axis(axis, spot, nominal)
    second = _second_axis(element, first, spot, nominal) if kind == "universal" else None
    limit, dynamics = (None, None) if axis is None else (axis.find("limit"), axis.find("dynamics"))
    effort, velocity = (_limit(limit, tag, -1.0) for tag in ("effort", "velocity"))
    limit = limit if kind in LIMITED else None
    _note_unread(element, kind, context)
    joint = Joint(
        name=spot.prefix + name_of(element),
        kind=kind,
        parent=parent,
        child=child,
        pose=moved @ nominal,
        axis=moved.rotate(first),
        lower=_limit(limit, "lower", -math.inf),
        upper=_limit(limit, "upper", math.inf),
        effort=math.inf if effort < 0 else effort,
        velocity=math.inf if velocity < 0 else velocity,
        damping=0.0 if dynamics is None else number(dynamics, "damping", 0.0),
        axis2=None if second is None else moved.rotate(second),
    )
    if limit is not None and (
        joint.lower > joint.upper or joint.lower == math.inf or joint.upper == -math.inf
    ):
        raise complain(
            limit, f"the lower limit {joint.lower:g} is above the upper limit {joint.upper:g}"
        )
    if dynamics is not None and joint.damping < 0:
        raise complain(dynamics, f"damping must not be negative, found {joint.damping:g}")
    return _relative_to_start(joint, first, links)


def _end(element: Element, tag: str, spot: Spot, links: dict[str, LinkPose]) -> str:
    """The full name of the link at one end of a joint, or `world`."""
    child = element.find(tag)
    name = text_of(child)
    if tag == "parent" and name == WORLD:
        return WORLD
    link = spot.scope.link(name, element) if name else None
    if link is None or spot.prefix + link not in links:
        wrong = element if child is None else child
        raise complain(wrong, f"<{tag}> is not a link of this model: '{name}'")
    return spot.prefix + link


def _axis(axis: Element | None, spot: Spot, joint_pose: Pose) -> Vector:
    """The unit vector of an `<axis>` in the world frame, at the nominal poses."""
    if axis is None:
        return joint_pose.rotate((0.0, 0.0, 1.0))
    frame = joint_pose
    unit = (0.0, 0.0, 1.0)
    element = axis.find("xyz")
    if version(axis) < (1, 7) and truth(axis, "use_parent_model_frame", version(axis) < (1, 5)):
        frame = spot.nominal
    if element is not None:
        x, y, z = numbers(element, 3)
        length = math.sqrt(x * x + y * y + z * z)
        if not 1e-9 < length < 1e9:
            raise complain(element, "the axis has no usable length")
        unit = x / length, y / length, z / length
        if named := element.get("expressed_in"):
            frame = spot.nominal @ spot.scope.pose(named, element)
    return frame.rotate(unit)


def _second_axis(element: Element, first: Vector, spot: Spot, joint_pose: Pose) -> Vector:
    axis2 = element.find("axis2")
    if axis2 is None:
        raise complain(element, "a universal joint needs an <axis2>")
    second = _axis(axis2, spot, joint_pose)
    along = sum(a * b for a, b in zip(first, second, strict=True))
    if abs(along) > 1e-3:
        raise complain(axis2, "the two axes of a universal joint must be perpendicular")
    x, y, z = (b - along * a for a, b in zip(first, second, strict=True))
    length = math.sqrt(x * x + y * y + z * z)
    return x / length, y / length, z / length


def _relative_to_start(joint: Joint, axis: Vector, links: dict[str, LinkPose]) -> Joint:
    """`joint` with limits relative to the actual poses of its links; `axis` is at the nominal
    ones.
    """
    if math.isinf(joint.lower) and math.isinf(joint.upper):
        return joint
    parent = links.get(joint.parent, LinkPose(Pose(), Pose()))
    child = links[joint.child]
    seen = parent.nominal @ parent.actual.inverse() @ child.actual
    if joint.kind == "prismatic":
        moved = [a - b for a, b in zip(seen.position, child.nominal.position, strict=True)]
        here = sum(a * b for a, b in zip(moved, axis, strict=True))
    else:
        w, *turn = (seen @ child.nominal.inverse()).quaternion
        here = 2 * math.atan2(sum(a * b for a, b in zip(turn, axis, strict=True)), w)
        # Plus the whole number of turns that brings it nearest to the limits.
        turns = [here + 2 * math.pi * number for number in (0, 1, -1, 2, -2)]
        here = min(turns, key=lambda turn: max(joint.lower - turn, turn - joint.upper, 0.0))
    return replace(joint, lower=joint.lower - here, upper=joint.upper - here)


def _note_unread(element: Element, kind: str, context: Context) -> None:
    for axis in (
        each for each in (element.find("axis"), element.find("axis2")) if each is not None
    ):
        limit = axis.find("limit")
        old = axis.find("use_parent_model_frame")
        bounds = [] if limit is None else [*limit.iter("lower"), *limit.iter("upper")]
        if (
            limit is not None
            and kind not in LIMITED
            and any(abs(sum(floats(one))) < UNLIMITED for one in bounds)
        ):
            context.note("ignored", limit, f"the limits of a {kind} joint")
        if old is not None and version(old) >= (1, 7):
            context.note("ignored", old, "it has no effect since SDF 1.7")


def _limit(limit: Element | None, tag: str, default: float) -> float:
    """The number in child `tag` of `limit`, which may be infinite, or `default`. Raises
    UserError.
    """
    child = None if limit is None else limit.find(tag)
    if child is None:
        return default
    values = floats(child)
    value = values[0] if len(values) == 1 and math.isinf(values[0]) else numbers(child, 1)[0]
    if abs(value) >= UNLIMITED:
        return math.copysign(math.inf, value)
    return value


def check_tree(joints: list[Joint], element: Element) -> None:
    """Raises UserError if joints close a loop, or if a link is the child of two joints."""
    parents: dict[str, list[str]] = {}
    for joint in joints:
        if joint.child in parents:
            why = (
                f"link '{joint.child}' is the child of two joints; only trees of links are "
                "supported"
            )
            raise complain(element, why)
        parents[joint.child] = [joint.parent]
    try:
        TopologicalSorter(parents).prepare()
    except CycleError as error:
        raise complain(element, f"joints close a loop: {shown(error.args[1])}") from None
