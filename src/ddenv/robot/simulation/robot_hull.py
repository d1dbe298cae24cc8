"""Boxes that hold a robot, whatever its joints do."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ddenv.arrays import Floats
from ddenv.world.extent import Bounds, bounds, stacked
from ddenv.world.model import Joint, Model, held_with
from ddenv.world.pose import Pose, Vector

ENDLESS = 1e9  # m; half of a box that holds the world


@dataclass(frozen=True)
class Hull:
    """B boxes in the frame of the robot's first link, with `centers` and `halves` (B, 3) m: the robot is always inside them.

    No point of a box is farther than `reach` (m) from the frame's origin. A robot with loose parts or with unlimited sliding
    joints has a box of `ENDLESS` (m).
    """

    centers: Floats
    halves: Floats
    reach: float

    @classmethod
    def of(cls, robot: Model) -> Hull:
        low, high = stacked(_boxes(robot))
        centers, halves = (low + high) / 2, (high - low) / 2
        return cls(centers, halves, float(np.linalg.norm(np.abs(centers) + halves, axis=1).max(initial=0.0)))

    def bounds(self, place: Pose) -> Bounds:
        """The corners (B, 3) m and (B, 3) m of boxes along the world's axes around the boxes, with the first link at `place`."""
        turn = place.rotation()
        centers = self.centers @ turn.T + np.array(place.position)
        halves = self.halves @ np.abs(turn).T
        return centers - halves, centers + halves


def _boxes(robot: Model) -> Iterator[Bounds]:
    """The box around each link, wherever its joints take it."""
    frame, first = robot.links[0].pose.inverse(), robot.links[0].pose.position
    rigid, reached = held_with(robot, robot.links[0].name), _chains(robot)
    joint_of = {joint.child: joint for joint in robot.joints}
    for link in robot.links:
        box = bounds(link.collisions, frame if link.name in rigid else link.pose.inverse())
        if box is None:
            continue
        if link.name in rigid:
            yield box
            continue
        joint = joint_of.get(link.name)
        if joint is not None and joint.parent in rigid:
            center, far = joint.pose.position, _slide(joint)
        else:
            # Several joints in a row: a ball around the first link.
            center, far = first, reached[link.name][1] if link.name in reached else math.inf
        start = joint.pose.position if joint is not None else link.pose.position
        corner = float(np.linalg.norm(np.abs(box).max(axis=0)))
        far = min(ENDLESS, far + math.dist(start, link.pose.position) + corner)
        middle = np.array((frame @ Pose(center)).position)
        yield middle - far, middle + far


def _chains(robot: Model) -> dict[str, tuple[Vector, float]]:
    """For each link that joints connect with the first one: its joint's place, and the distance there along the joints, m."""
    chains = {robot.links[0].name: (robot.links[0].pose.position, 0.0)}
    # A file may name its joints in any order.
    for _ in robot.joints:
        for joint in robot.joints:
            if joint.parent in chains and joint.child not in chains:
                start, length = chains[joint.parent]
                chains[joint.child] = (
                    joint.pose.position,
                    length + math.dist(start, joint.pose.position) + _slide(joint),
                )
    return chains


def _slide(joint: Joint) -> float:
    """How far `joint` moves its child along its axis, m."""
    return max(abs(joint.lower), abs(joint.upper)) if joint.kind == "prismatic" else 0.0
