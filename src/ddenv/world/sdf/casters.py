"""Caster balls: a ball joint whose child is one sphere around the joint.

Drake describes a ball joint by roll, pitch and yaw, which become singular where the ball has rolled
through a quarter of a turn. A ball that rolls freely under a robot pulls at it with nothing but its
own small inertia. So a sphere that slides without friction stands for it.
"""

from __future__ import annotations

import math
from dataclasses import replace

from ddenv.world.model import Collision, Joint, Link, Model, Sphere
from ddenv.world.sdf.context import Context
from ddenv.world.sdf.xml import Element

# Maximum distance of a ball's centre from its joint, as a part of its radius.
OFF_CENTRE = 0.01


def without_ball_joints(model: Model, element: Element, context: Context) -> Model:
    """`model`, with spheres that are fixed and have no friction in place of its caster balls;
    `element` is its `<model>`.
    """
    balls = {joint.child: joint for joint in model.joints if _is_caster(joint, model)}
    if not balls:
        return model
    for joint in balls.values():
        why = "a ball joint: the sphere of its caster ball is fixed, and slides without friction"
        context.note("replaced", element, why, joint.name)
    joints = tuple(
        replace(joint, kind="fixed") if joint.child in balls else joint for joint in model.joints
    )
    links = tuple(_slippery(link) if link.name in balls else link for link in model.links)
    return replace(model, joints=joints, links=links)


def _is_caster(joint: Joint, model: Model) -> bool:
    if joint.kind != "ball" or any(other.parent == joint.child for other in model.joints):
        return False
    child = next(link for link in model.links if link.name == joint.child)
    return bool(child.collisions) and all(_is_around(one, joint) for one in child.collisions)


def _is_around(collision: Collision, joint: Joint) -> bool:
    if not isinstance(collision.shape, Sphere):
        return False
    off_centre = math.dist(collision.pose.position, joint.pose.position)
    return off_centre <= OFF_CENTRE * collision.shape.radius


def _slippery(link: Link) -> Link:
    return replace(link, collisions=tuple(replace(one, mu=0.0) for one in link.collisions))
