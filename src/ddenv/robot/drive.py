"""The drive of a skid-steered robot: which wheels it has, and which speeds turn it as commanded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ddenv.errors import UserError
from ddenv.robot.joints import is_fixed
from ddenv.robot.navigate import Command
from ddenv.world.model import Cylinder, Joint, Model, Sphere


@dataclass(frozen=True, slots=True)
class Drive:
    """Wheel joints by name in the model's order; `left` tells the side of each. Radius and track in m."""

    joints: tuple[str, ...]
    left: tuple[bool, ...]
    radius: float
    track: float

    def wheel_speeds(self, command: Command, skid: float) -> np.ndarray:
        """Angular speeds (rad/s) of all wheels; `skid` is the part of a commanded turn that the ground lets through."""
        difference = command.turn_rate / skid * self.track / 2
        left, right = (command.speed - difference) / self.radius, (command.speed + difference) / self.radius
        return np.array([left if is_left else right for is_left in self.left])


def is_wheel(joint: Joint) -> bool:
    """Whether `joint` of a robot turns a wheel and has a motor; joints that slide or turn about two axes are left alone."""
    return joint.kind in ("revolute", "continuous") and not is_fixed(joint)


def find_drive(robot: Model) -> Drive:
    """The drive of `robot`: every joint that turns about one axis is a wheel. Raises UserError where that cannot be."""
    joints = [joint for joint in robot.joints if is_wheel(joint)]
    sides = [robot.pose.inverse().rotate(_offset(robot, joint))[1] for joint in joints]
    if not any(side > 0 for side in sides) or not any(side < 0 for side in sides):
        raise UserError(
            f"robot '{robot.name}': expected wheels on both sides: joints that turn, left and right of the model's x axis"
        )
    left = [side for side in sides if side > 0]
    right = [side for side in sides if side <= 0]
    return Drive(
        joints=tuple(joint.name for joint in joints),
        left=tuple(side > 0 for side in sides),
        radius=sum(_radius(robot, joint) for joint in joints) / len(joints),
        track=sum(left) / len(left) - sum(right) / len(right),
    )


def _offset(robot: Model, joint: Joint) -> tuple[float, float, float]:
    x, y, z = (a - b for a, b in zip(joint.pose.position, robot.pose.position, strict=True))
    return (x, y, z)


def _radius(robot: Model, joint: Joint) -> float:
    link = next(link for link in robot.links if link.name == joint.child)
    radii = [c.shape.radius for c in link.collisions if isinstance(c.shape, Cylinder | Sphere)]
    if not radii:
        raise UserError(f"robot '{robot.name}': wheel '{link.name}' has no cylinder or sphere as its collision")
    return max(radii)
