"""The drive of a wheeled robot: which joints are wheels, how fast each must turn for a command, and
how far each rolls on a way.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ddenv.arrays import Floats
from ddenv.errors import UserError
from ddenv.schemas import nearest
from ddenv.text import Names
from ddenv.world.extent import bounds
from ddenv.world.model import (
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Joint,
    Link,
    Mesh,
    Model,
    Sphere,
    held_with,
    is_fixed,
)
from ddenv.world.pose import Pose, Vector
from ddenv.world.scenario import Wheels

# How much of a wheel's axis must point sideways: a swivel or a turret is no wheel.
ACROSS = 0.5
# The minimum distance between left and right wheels, m.
NARROWEST = 1e-3


class Twist(NamedTuple):
    """Forward speed in m/s and turn rate in rad/s, positive to the left."""

    speed: float
    turn_rate: float


@dataclass(frozen=True, slots=True)
class WheelSpeeds:
    """Angular speeds of the wheel joints by name, rad/s, positive forward. A wheel that is not
    named stands still.
    """

    speeds: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Drive:
    """The wheel joints by name, in the model's order; `left` is True for those on the left side.
    `radius` and `track` in m.

    `signs` are 1 for wheels whose joint velocity is positive when they roll forward, and -1 for the
    others.
    """

    joints: Names
    left: tuple[bool, ...]
    radius: float
    track: float
    signs: tuple[float, ...]

    def wheel_speeds(self, command: Twist | WheelSpeeds, skid: float) -> Floats:
        """The joint velocities (N,) of all wheels, rad/s.

        `skid` is the ratio of the robot's turn rate to the one its wheels command.
        """
        if isinstance(command, WheelSpeeds):
            return np.asarray(
                np.array([command.speeds.get(joint, 0.0) for joint in self.joints]) * self.signs
            )
        difference = command.turn_rate / skid * self.track / 2
        left = (command.speed - difference) / self.radius
        right = (command.speed + difference) / self.radius
        sides = zip(self.left, self.signs, strict=True)
        return np.array([sign * (left if is_left else right) for is_left, sign in sides])


def find_drive(robot: Model, wheels: Wheels | None = None) -> Drive:
    """The drive of `robot`: the joints in `wheels`, or else every joint that turns about one axis.

    Raises UserError for a robot that is static, or whose joints are no wheels on two sides.
    """
    if robot.static:
        raise UserError(
            f"robot '{robot.name}': is static and cannot move; remove <static> from its file"
        )
    if wheels is None:
        sides = {joint.name: _side(robot, joint) > 0 for joint in robot.joints if _turns(joint)}
        if set(sides.values()) != {True, False}:
            why = (
                "expected wheels on both sides: joints that turn, left and right of the model's "
                "x axis"
            )
            raise UserError(f"robot '{robot.name}': {why}; or name them in robot.wheels")
    else:
        sides = _named(robot, wheels)
    joints = [joint for joint in robot.joints if joint.name in sides]
    across = [_part_across(robot, joint) for joint in joints]
    for joint, part in zip(joints, across, strict=True):
        where = f"robot '{robot.name}': joint '{joint.name}'"
        if abs(part) < ACROSS:
            hint = "; name the driven wheels in robot.wheels" if wheels is None else ""
            raise UserError(f"{where} is not a wheel: its axis does not run across the robot{hint}")
        if joint.effort == 0.0:
            raise UserError(f"{where} is a wheel with an effort limit of 0; set one in N m")
    left = [_side(robot, joint) for joint in joints if sides[joint.name]]
    right = [_side(robot, joint) for joint in joints if not sides[joint.name]]
    track = sum(left) / len(left) - sum(right) / len(right)
    if track < NARROWEST:
        raise UserError(
            f"robot.wheels: the left wheels of '{robot.name}' must lie to the left of the right "
            "ones"
        )
    return Drive(
        joints=tuple(joint.name for joint in joints),
        left=tuple(sides[joint.name] for joint in joints),
        radius=sum(_radius(robot, joint) for joint in joints) / len(joints),
        track=track,
        signs=tuple(1.0 if part > 0 else -1.0 for part in across),
    )


def _part_across(robot: Model, joint: Joint) -> float:
    """How much of a joint's axis runs across the robot, to the left, -1..1."""
    return robot.pose.inverse().rotate(joint.axis)[1]


def turning_links(robot: Model) -> tuple[Link, ...]:
    """The links of all joints that may be wheels: they turn about an axis across the robot."""
    wheels = (
        joint
        for joint in robot.joints
        if _turns(joint) and abs(_part_across(robot, joint)) >= ACROSS
    )
    return tuple(link for joint in wheels for link in wheel_links(robot, joint))


def wheel_links(robot: Model, joint: Joint) -> list[Link]:
    """The links that a wheel's `joint` turns: its child, and all links that are fixed to it."""
    names = held_with(robot, joint.child)
    return [link for link in robot.links if link.name in names]


def rolled(robot: Model, drive: Drive, skid: float, rows: Floats) -> Floats:
    """How far the left and the right wheels have turned at each of `rows`, shape (N, 2), rad,
    positive forward.

    A run records where the robot was, not how its wheels turned. This is worked out from its way,
    by the kinematics of a skid-steer: it moves along its x axis without slip, and turns by `skid`
    of what its wheels command. Wheels that spin or slide turn otherwise. `rows` are the motion of
    the robot's first link, shape (N, 8): t (s), x, y, z (m), qw, qx, qy, qz.
    """
    if len(rows) < 2:
        return np.zeros((len(rows), 2))
    to_model = robot.links[0].pose.inverse() @ robot.pose
    ahead = np.array(
        [
            Pose((0.0, 0.0, 0.0), tuple(row[4:8])).rotate(to_model.rotate((1.0, 0.0, 0.0)))
            for row in rows.tolist()
        ]
    )
    between = (ahead[:-1] + ahead[1:]) / 2
    moved = (np.diff(rows[:, 1:4], axis=0) * between).sum(axis=1)
    sideways = np.diff(np.unwrap(np.arctan2(ahead[:, 1], ahead[:, 0]))) * drive.track / skid / 2
    turns = np.column_stack([moved - sideways, moved + sideways]) / drive.radius
    return np.vstack([np.zeros(2), turns.cumsum(axis=0)])


def footprint(robot: Model) -> tuple[float, float, float, float]:
    """How far the collision shapes of `robot` extend from its origin, m: ahead, behind, to its
    left, to its right.
    """
    box = bounds(robot.collisions, robot.pose.inverse())
    if box is None:
        return 0.0, 0.0, 0.0, 0.0
    low, high = (side.tolist() for side in box)
    return high[0], -low[0], high[1], -low[1]


def _turns(joint: Joint) -> bool:
    return joint.kind in ("revolute", "continuous") and not is_fixed(joint)


def _named(robot: Model, wheels: Wheels) -> dict[str, bool]:
    """The joints that `wheels` lists, and whether they are listed on the left."""
    turning = [joint.name for joint in robot.joints if _turns(joint)]
    others = {joint.name: joint.kind for joint in robot.joints if not _turns(joint)}
    if turning:
        these = f"joints of '{robot.name}' that turn are {', '.join(turning)}"
    else:
        these = "none of its joints turns"
    for side, names in (("left", wheels.left), ("right", wheels.right)):
        for name in names:
            why = f"there is no joint '{name}'{nearest(name, turning)}"
            if name in others:
                why = f"'{name}' is a {others[name]} joint that does not turn"
            else:
                why = why
            if name not in turning:
                raise UserError(f"robot.wheels.{side}: {why}; {these}")
    name, times = Counter([*wheels.left, *wheels.right]).most_common(1)[0]
    if times > 1:
        both = "on both sides" if name in wheels.left and name in wheels.right else "twice"
        raise UserError(f"robot.wheels: joint '{name}' is listed {both}")
    return dict.fromkeys(wheels.left, True) | dict.fromkeys(wheels.right, False)


def _side(robot: Model, joint: Joint) -> float:
    """How far `joint` lies to the left of the model's x axis, m."""
    x, y, z = (a - b for a, b in zip(joint.pose.position, robot.pose.position, strict=True))
    return robot.pose.inverse().rotate((x, y, z))[1]


def _radius(robot: Model, joint: Joint) -> float:
    """The radius of the wheel on `joint`, m."""
    radii = [
        _round(one, joint.axis) for link in wheel_links(robot, joint) for one in link.collisions
    ]
    if not any(radii):
        what = "a cylinder, sphere, capsule, ellipsoid or mesh"
        raise UserError(
            f"robot '{robot.name}': wheel '{joint.child}' has no round collision: {what}"
        )
    return max(radii)


def _round(collision: Collision, axis: Vector) -> float:
    """The radius of a wheel that turns about the unit vector `axis`, m; 0 for a shape that is not
    round.
    """
    across = np.eye(3) - np.outer(axis, axis)
    match collision.shape:
        case Cylinder(radius) | Sphere(radius) | Capsule(radius):
            return radius
        case Ellipsoid(radii):
            return float(np.linalg.norm(across @ collision.pose.rotation() * radii, ord=2))
        case Mesh(_, vertices):
            points = vertices @ collision.pose.rotation().T @ across
            apart = points[:, None] - points[None, :]
            return float(np.sqrt((apart**2).sum(axis=2).max())) / 2
    return 0.0
