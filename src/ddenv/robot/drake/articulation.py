"""The joints of models in Drake."""

from __future__ import annotations

import math

import numpy as np
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform, RotationMatrix
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import (
    BallRpyJoint,
    FixedOffsetFrame,
    PrismaticJoint,
    RevoluteJoint,
    RigidBody,
    RotationalInertia,
    SpatialInertia,
    UniversalJoint,
    WeldJoint,
)
from pydrake.multibody.tree import Joint as DrakeJoint

from ddenv.world.model import Inertia, Joint, Link, Model
from ddenv.world.pose import Pose


def transform(pose: Pose) -> RigidTransform:
    """`pose` as Drake's transform."""
    return RigidTransform(Quaternion(np.array(pose.quaternion)), np.array(pose.position))


def spatial_inertia(inertia: Inertia, link: Pose) -> SpatialInertia:
    """`inertia` about the origin of the frame `link`, in its axes. Raises RuntimeError for impossible inertias."""
    place = transform(link.inverse() @ inertia.pose)
    central = RotationalInertia(*inertia.moments, *inertia.products).ReExpress(place.rotation())
    return SpatialInertia.MakeFromCentralInertia(inertia.mass, place.translation(), central)


# A joint with less play than this (rad or m) is fixed.
PLAY = 1e-4
# Drake's ball joint has roll, pitch and yaw, and locks where the child's x axis comes to lie along the parent's z axis. These
# axes, the same on both sides, are at different angles to each axis of the world, so that no swing about one of those,
# as of something that was hung up straight, leads there.
BALL_AXES = np.array([[0.8, 0.0, -0.6], [0.36, 0.8, 0.48], [0.48, -0.6, 0.64]])

Linked = dict[str, tuple[Link, RigidBody]]


def is_fixed(joint: Joint) -> bool:
    """Whether `joint` lets nothing move."""
    limited = joint.kind in ("revolute", "prismatic")
    return joint.kind == "fixed" or (limited and joint.upper - joint.lower < PLAY and joint.lower <= 0 <= joint.upper)


def anchored(model: Model) -> frozenset[str]:
    """The links of `model` that fixed joints hold in the world: they never move."""
    held = {"world"}
    fixed = [joint for joint in model.joints if is_fixed(joint)]
    while new := {joint.child for joint in fixed if joint.parent in held} - held:
        held |= new
    return frozenset(held - {"world"})


def add_joint(plant: MultibodyPlant, joint: Joint, links: Linked, instance_name: str) -> None:
    """Adds `joint` between two of `links`, or one of them and the world."""
    # Both frames have the same axes in the start pose, so that every position of a joint is 0 there.
    at = RigidTransform(RotationMatrix(_axes(joint)), np.array(joint.pose.position))
    frames = []
    for end, name in (("parent", joint.parent), ("child", joint.child)):
        pose, body = (Pose(), plant.world_body()) if name == "world" else (links[name][0].pose, links[name][1])
        place = transform(pose).inverse() @ at
        frames.append(plant.AddFrame(FixedOffsetFrame(f"{instance_name}/{joint.name}/{end}", body.body_frame(), place)))
    plant.AddJoint(_joint(joint, frames))


def _axes(joint: Joint) -> np.ndarray:
    """The axes of a joint's frames in the world, as columns: the world's, where a kind of joint needs no others."""
    if joint.kind == "universal":
        first, second = np.array(joint.axis), np.array(joint.axis2)
        # Right angles to the last bit, which those of a file are not.
        second = second - first * (first @ second)
        second /= math.sqrt(second @ second)
        return np.column_stack([first, second, np.cross(first, second)])
    return BALL_AXES if joint.kind == "ball" else np.eye(3)


def _joint(joint: Joint, frames: list[FixedOffsetFrame]) -> DrakeJoint:
    if is_fixed(joint):
        return WeldJoint(joint.name, *frames, RigidTransform())
    axis = np.array(joint.axis)
    match joint.kind:
        case "revolute" | "continuous":
            return RevoluteJoint(joint.name, *frames, axis, joint.lower, joint.upper, joint.damping)
        case "prismatic":
            return PrismaticJoint(joint.name, *frames, axis, joint.lower, joint.upper, joint.damping)
        case "ball":
            return BallRpyJoint(joint.name, *frames, joint.damping)
        case "universal":
            return UniversalJoint(joint.name, *frames, joint.damping)
    raise ValueError(f"joint '{joint.name}': {joint.kind} joints cannot be simulated")
