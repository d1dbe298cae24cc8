"""The drive of a robot on wheels: which joints it drives, and how fast each turns for what is commanded."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass

import numpy as np

from ddenv.errors import UserError
from ddenv.robot.drake.articulation import is_fixed
from ddenv.robot.protocol import Twist, WheelSpeeds
from ddenv.schemas import nearest
from ddenv.world.extent import shape_bounds
from ddenv.world.model import Capsule, Collision, Cylinder, Ellipsoid, Joint, Link, Mesh, Model, Sphere
from ddenv.world.pose import Vector
from ddenv.world.scenario import Wheels

# How much of a wheel's axis must lie across the robot at least: a swivel or a turret is no wheel.
ACROSS = 0.5
# The least distance between left and right wheels, m.
NARROWEST = 1e-3


@dataclass(frozen=True, slots=True)
class Drive:
    """Wheel joints by name in the model's order; `left` tells the side of each. Radius and track in m.

    `signs` are 1 where a wheel that rolls forward turns about its joint's axis, and -1 where it turns against it.
    """

    joints: tuple[str, ...]
    left: tuple[bool, ...]
    radius: float
    track: float
    signs: tuple[float, ...]

    def wheel_speeds(self, command: Twist | WheelSpeeds, skid: float) -> np.ndarray:
        """Angular speeds (rad/s) of all wheels about the axes of their joints, shape (N,).

        `skid` is the part of a commanded turn that the ground lets through. Raises ValueError for a wheel that is not there.
        """
        if isinstance(command, WheelSpeeds):
            return self._by_name(command)
        difference = command.turn_rate / skid * self.track / 2
        left, right = (command.speed - difference) / self.radius, (command.speed + difference) / self.radius
        sides = zip(self.left, self.signs, strict=True)
        return np.array([sign * (left if is_left else right) for is_left, sign in sides])

    def _by_name(self, command: WheelSpeeds) -> np.ndarray:
        unknown = set(command.speeds) - set(self.joints)
        if unknown:
            raise ValueError(f"'{min(unknown)}' is no wheel; wheels are {', '.join(self.joints)}")
        return np.array([command.speeds.get(joint, 0.0) for joint in self.joints]) * self.signs


def find_drive(robot: Model, wheels: Wheels | None = None) -> Drive:
    """The drive of `robot`: the joints in `wheels`, or else every joint that turns about one axis. Raises UserError."""
    if robot.static:
        raise UserError(f"robot '{robot.name}': is static, and would never move; take <static> out of its file")
    sides = _placed(robot) if wheels is None else _named(robot, wheels)
    joints = [joint for joint in robot.joints if joint.name in sides]
    across = [robot.pose.inverse().rotate(joint.axis)[1] for joint in joints]
    for joint, part in zip(joints, across, strict=True):
        if abs(part) < ACROSS:
            hint = "; name the driven wheels in robot.wheels" if wheels is None else ""
            raise UserError(
                f"robot '{robot.name}': joint '{joint.name}' is no wheel: its axis is not across the robot{hint}"
            )
        if joint.effort == 0.0:
            raise UserError(f"robot '{robot.name}': wheel joint '{joint.name}' has an effort of 0; give it one in N m")
    left = [_side(robot, joint) for joint in joints if sides[joint.name]]
    right = [_side(robot, joint) for joint in joints if not sides[joint.name]]
    track = sum(left) / len(left) - sum(right) / len(right)
    if track < NARROWEST:
        raise UserError(f"robot.wheels: the left wheels of '{robot.name}' are not to the left of the right ones")
    return Drive(
        joints=tuple(joint.name for joint in joints),
        left=tuple(sides[joint.name] for joint in joints),
        radius=sum(_radius(robot, joint) for joint in joints) / len(joints),
        track=track,
        signs=tuple(1.0 if part > 0 else -1.0 for part in across),
    )


def turned_links(robot: Model, joints: tuple[str, ...]) -> frozenset[str]:
    """The names of the links that `joints` turn: their child links, and what is fixed to those."""
    return frozenset(link.name for joint in robot.joints if joint.name in joints for link in _wheel(robot, joint))


def footprint(robot: Model) -> tuple[float, float, float, float]:
    """How far the collisions of `robot` reach from its origin, m: ahead, behind, to its left, to its right."""
    frame = robot.pose.inverse()
    boxes = [shape_bounds(one.shape, frame @ one.pose) for one in robot.collisions]
    if not boxes:
        return 0.0, 0.0, 0.0, 0.0
    low = np.min([box[0] for box in boxes], axis=0).tolist()
    high = np.max([box[1] for box in boxes], axis=0).tolist()
    return high[0], -low[0], high[1], -low[1]


def _turns(joint: Joint) -> bool:
    return joint.kind in ("revolute", "continuous") and not is_fixed(joint)


def _placed(robot: Model) -> dict[str, bool]:
    """Every joint that turns about one axis, and whether it is on the left."""
    sides = {joint.name: _side(robot, joint) > 0 for joint in robot.joints if _turns(joint)}
    if set(sides.values()) != {True, False}:
        raise UserError(
            f"robot '{robot.name}': expected wheels on both sides: joints that turn, left and right of the model's x axis; "
            "or name them in robot.wheels"
        )
    return sides


def _named(robot: Model, wheels: Wheels) -> dict[str, bool]:
    """The joints that `wheels` names, and whether they are named on the left."""
    turning = [joint.name for joint in robot.joints if _turns(joint)]
    others = {joint.name: joint.kind for joint in robot.joints if not _turns(joint)}
    these = f"joints of '{robot.name}' that turn are {', '.join(turning)}" if turning else "none of its joints turns"
    for side, names in (("left", wheels.left), ("right", wheels.right)):
        for name in names:
            if name in others:
                raise UserError(f"robot.wheels.{side}: '{name}' is a {others[name]} joint that does not turn; {these}")
            if name not in turning:
                raise UserError(f"robot.wheels.{side}: there is no joint '{name}'{nearest(name, turning)}; {these}")
    name, times = Counter([*wheels.left, *wheels.right]).most_common(1)[0]
    if times > 1:
        both = "on both sides" if name in wheels.left and name in wheels.right else "twice"
        raise UserError(f"robot.wheels: joint '{name}' is named {both}")
    return dict.fromkeys(wheels.left, True) | dict.fromkeys(wheels.right, False)


def _side(robot: Model, joint: Joint) -> float:
    """How far left of the model's x axis `joint` is, m."""
    x, y, z = (a - b for a, b in zip(joint.pose.position, robot.pose.position, strict=True))
    return robot.pose.inverse().rotate((x, y, z))[1]


def _wheel(robot: Model, joint: Joint) -> list[Link]:
    """The child link of `joint`, and what is fixed to it."""
    names = {joint.child}
    fixed = [each for each in robot.joints if is_fixed(each)]
    while new := {each.child for each in fixed if each.parent in names} - names:
        names |= new
    return [link for link in robot.links if link.name in names]


def _radius(robot: Model, joint: Joint) -> float:
    collisions = [collision for link in _wheel(robot, joint) for collision in link.collisions]
    radii = [_round(collision, joint.axis) for collision in collisions]
    if not any(radii):
        what = "a cylinder, sphere, capsule, ellipsoid or mesh"
        raise UserError(f"robot '{robot.name}': wheel '{joint.child}' has no round collision: {what}")
    return max(radii)


def _round(collision: Collision, axis: Vector) -> float:
    """The radius of a wheel that turns about `axis`, m; 0 for a shape that no wheel has."""
    match collision.shape:
        case Cylinder(radius) | Sphere(radius) | Capsule(radius):
            return radius
        case Ellipsoid(radii):
            turned = _across(axis) @ collision.pose.rotation() * radii
            return float(np.linalg.norm(turned, ord=2))
        case Mesh(_, vertices):
            points = vertices @ collision.pose.rotation().T @ _across(axis)
            apart = points[:, None] - points[None, :]
            return float(np.sqrt((apart**2).sum(axis=2).max())) / 2
    return 0.0


def _across(axis: Vector) -> np.ndarray:
    """Takes from a vector its part along the unit vector `axis`, shape (3, 3)."""
    return np.eye(3) - np.outer(axis, axis)
