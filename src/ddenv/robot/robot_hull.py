"""Boxes that hold a robot, whatever its joints do."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ddenv.arrays import Floats
from ddenv.robot.drake.shapes import solid_bounds
from ddenv.robot.surroundings import chains, slide
from ddenv.world.extent import Bounds
from ddenv.world.model import Model, is_fixed
from ddenv.world.pose import Pose

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
        boxes = _boxes(robot)
        centers = np.array([(low + high) / 2 for low, high in boxes]).reshape(-1, 3)
        halves = np.array([(high - low) / 2 for low, high in boxes]).reshape(-1, 3)
        reach = float(np.linalg.norm(np.abs(centers) + halves, axis=1).max(initial=0.0))
        return cls(centers, halves, reach)

    def bounds(self, place: Pose) -> Bounds:
        """The corners (B, 3) m and (B, 3) m of boxes along the world's axes around the boxes, with the first link at `place`."""
        turn = place.rotation()
        centers = self.centers @ turn.T + np.array(place.position)
        halves = self.halves @ np.abs(turn).T
        return centers - halves, centers + halves


def _boxes(robot: Model) -> list[Bounds]:
    frame, first = robot.links[0].pose.inverse(), robot.links[0].pose.position
    rigid, reached = _rigid(robot), chains(robot)
    joint_of = {joint.child: joint for joint in robot.joints}
    boxes = []
    for link in robot.links:
        if not link.collisions:
            continue
        box = solid_bounds(link.collisions, frame if link.name in rigid else link.pose.inverse())
        assert box is not None
        if link.name not in rigid:
            corner = float(np.linalg.norm(np.abs(box).max(axis=0)))
            joint = joint_of.get(link.name)
            if joint is not None and joint.parent in rigid:
                center, far = joint.pose.position, slide(joint)
            else:
                # Several joints in a row: a ball around the first link.
                center, far = first, reached[link.name][1] if link.name in reached else math.inf
            start = joint.pose.position if joint is not None else link.pose.position
            far = min(ENDLESS, far + math.dist(start, link.pose.position) + corner)
            middle = np.array((frame @ Pose(center)).position)
            box = middle - far, middle + far
        boxes.append(box)
    return boxes


def _rigid(robot: Model) -> frozenset[str]:
    """The links that do not move against the first one."""
    held = {robot.links[0].name}
    fixed = [{joint.parent, joint.child} for joint in robot.joints if is_fixed(joint)]
    while new := {name for pair in fixed if pair & held for name in pair} - held:
        held |= new
    return frozenset(held)
