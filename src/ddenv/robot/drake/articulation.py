"""Joints, poses and inertias of our models as Drake's own types."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    BallRpyJoint,
    FixedOffsetFrame,
    Frame,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    RotationalInertia,
    SpatialInertia,
    UniversalJoint,
    WeldJoint,
)
from pydrake.multibody.tree import Joint as DrakeJoint

from ddenv.arrays import Floats
from ddenv.world.model import Inertia, Joint, Link, Model, is_fixed
from ddenv.world.pose import Pose


def to_drake(array: Floats) -> Any:
    """`array` itself: pydrake's type stubs declare arrays in a form that no NumPy array matches."""
    return array


def transform(pose: Pose) -> RigidTransform:
    """`pose` as Drake's transform."""
    return RigidTransform(Quaternion(to_drake(np.array(pose.quaternion))), to_drake(np.array(pose.position)))


def spatial_inertia(inertia: Inertia, link: Pose) -> SpatialInertia:
    """`inertia` about the origin of the frame `link`, in its axes. Raises RuntimeError for an impossible inertia."""
    place = transform(link.inverse() @ inertia.pose)
    central = RotationalInertia(*inertia.moments, *inertia.products).ReExpress(place.rotation())
    return SpatialInertia.MakeFromCentralInertia(inertia.mass, place.translation(), central)


# Drake's ball joint has roll, pitch and yaw, and locks (gimbal lock) where the child's x axis is parallel to the parent's z axis.
# These joint axes, the same on both sides, are oblique to every axis of the world, so that no swing about one of those, like that
# of something that hangs straight down, reaches the lock.
BALL_AXES = np.array([[0.8, 0.0, -0.6], [0.36, 0.8, 0.48], [0.48, -0.6, 0.64]])

Linked = dict[str, tuple[Link, RigidBody]]


def anchored(model: Model) -> frozenset[str]:
    """The names of the links of `model` that fixed joints attach to the world: they never move."""
    held = {"world"}
    fixed = [joint for joint in model.joints if is_fixed(joint)]
    while new := {joint.child for joint in fixed if joint.parent in held} - held:
        held |= new
    return frozenset(held - {"world"})


def add_joint(plant: MultibodyPlant, joint: Joint, links: Linked, instance_name: str) -> None:
    """Adds `joint` between two of `links`, or between one of them and the world. Raises ValueError for an unknown kind."""
    # Both frames have the same axes in the start pose, so that every joint position is 0 there.
    at = RigidTransform(RotationMatrix(to_drake(_axes(joint))), to_drake(np.array(joint.pose.position)))
    frames: list[Frame] = []
    for end, name in (("parent", joint.parent), ("child", joint.child)):
        pose, body = (Pose(), plant.world_body()) if name == "world" else (links[name][0].pose, links[name][1])
        place = transform(pose).inverse() @ at
        frames.append(plant.AddFrame(FixedOffsetFrame(f"{instance_name}/{joint.name}/{end}", body.body_frame(), place)))
    parent, child = frames
    plant.AddJoint(_joint(joint, parent, child))


def _axes(joint: Joint) -> Floats:
    """The axes (columns of a 3 x 3 matrix) of a joint's frames in the world frame; the world's own for most kinds."""
    if joint.kind == "universal":
        first, second = np.array(joint.axis), np.array(joint.axis2)
        # Exactly orthogonal: the axes of a file are so only to a few digits.
        second = second - first * (first @ second)
        second /= math.sqrt(second @ second)
        return np.column_stack([first, second, np.cross(first, second)])
    return BALL_AXES if joint.kind == "ball" else np.eye(3)


def _joint(joint: Joint, parent: Frame, child: Frame) -> DrakeJoint:
    if is_fixed(joint):
        return WeldJoint(joint.name, parent, child, RigidTransform())
    axis = to_drake(np.array(joint.axis))
    match joint.kind:
        case "revolute" | "continuous":
            return RevoluteJoint(joint.name, parent, child, axis, joint.lower, joint.upper, joint.damping)
        case "prismatic":
            return PrismaticJoint(joint.name, parent, child, axis, joint.lower, joint.upper, joint.damping)
        case "ball":
            return BallRpyJoint(joint.name, parent, child, joint.damping)
        case "universal":
            return UniversalJoint(joint.name, parent, child, joint.damping)
    raise ValueError(f"joint '{joint.name}': {joint.kind} joints cannot be simulated")
