"""How far a robot reaches from its first link, however its joints stand."""

from __future__ import annotations

import math

import numpy as np

from ddenv.robot.shapes import solid_bounds
from ddenv.world.model import Joint, Model
from ddenv.world.pose import Vector


def reach(robot: Model) -> float:
    """No point of the robot's geometry is farther than this from the origin of its first link, m.

    Infinite for a robot with loose parts, or joints that slide without an end.
    """
    ways = _ways(robot)
    farthest = 0.0
    for link in robot.links:
        box = solid_bounds(link.collisions, link.pose.inverse())
        if box is None:
            continue
        if link.name not in ways:
            return math.inf
        start, way = ways[link.name]
        corner = float(np.linalg.norm(np.abs(box).max(axis=0)))
        farthest = max(farthest, way + math.dist(start, link.pose.position) + corner)
    return farthest


def _ways(robot: Model) -> dict[str, tuple[Vector, float]]:
    """For each link that hangs on the first one: the place of its joint, and the way there from joint to joint, m."""
    ways = {robot.links[0].name: (robot.links[0].pose.position, 0.0)}
    # Joints may stand in any order.
    for _ in robot.joints:
        for joint in robot.joints:
            if joint.parent in ways and joint.child not in ways:
                start, way = ways[joint.parent]
                ways[joint.child] = joint.pose.position, way + math.dist(start, joint.pose.position) + _slide(joint)
    return ways


def _slide(joint: Joint) -> float:
    """How far `joint` moves its child along its axis, m."""
    return max(abs(joint.lower), abs(joint.upper)) if joint.kind == "prismatic" else 0.0
