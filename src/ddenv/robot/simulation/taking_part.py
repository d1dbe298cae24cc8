"""Which models can have changed a bit of a run: those without which the same run might go
otherwise.

Whatever nothing comes near changes no bit. So a model takes part if the robot or a model that is
simulated may have touched it between two ticks, if a beam of a scan that the controller read ended
on it, if it was simulated itself, or if it belongs to a pile that does not move as in the whole
world. That is more than what touched, and never less.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from ddenv.arrays import Booleans, Floats, Integers
from ddenv.robot.piles.sleep import Sleep
from ddenv.robot.result import PoseRow
from ddenv.world.extent import Bounds, bounds, shape_bounds, stacked
from ddenv.world.model import Joint, Model, World, held_with, still_links
from ddenv.world.pose import Pose, angle_between

# What happens between two ticks besides motion at the speed at one of them, m: half of g t^2 for t
# = 0.1 s.
SLACK = 0.05


def solids(world: World) -> dict[str, Bounds]:
    """The boxes around the S shapes of each model that never move: corners (S, 3) m and (S, 3) m.
    There are no planes.
    """
    shapes = {
        model.name: [one for link in still_links(model) for one in link.collisions]
        for model in world.models
    }
    return {
        name: stacked(shape_bounds(one.shape, one.pose) for one in found)
        for name, found in shapes.items()
        if found
    }


class Reached:
    """The models that never move which the robot, or a model that is simulated, may have touched in
    one run.

    `boxes` are `solids`, `hull` is the robot's; `present` are the models that are kept. No two
    ticks are more than `period` (s) apart.
    """

    def __init__(
        self,
        boxes: Mapping[str, Bounds],
        hull: Hull,
        sleep: Sleep,
        present: frozenset[str],
        period: float,
    ) -> None:
        self._hull = hull
        self._sleep = sleep
        self._period = period
        there = {name: box for name, box in boxes.items() if name in present}
        self._names = np.array([*there], dtype=object)
        # The shapes of models that were not reached yet.
        self._owners: Integers = np.repeat(
            np.arange(len(there)), np.array([len(low) for low, _ in there.values()], dtype=int)
        )
        self._low = np.vstack([np.empty((0, 3)), *(low for low, _ in there.values())])
        self._high = np.vstack([np.empty((0, 3)), *(high for _, high in there.values())])
        self._found: Booleans = np.zeros(len(there), dtype=bool)
        # From `_place` on the robot may move by `_free` (m) and reach nothing new.
        self._place: PoseRow | None = None
        self._free = 0.0

    @property
    def radius(self) -> float:
        """No part of the robot is farther from its first link's origin, m."""
        return self._hull.reach

    @property
    def names(self) -> frozenset[str]:
        """The models reached so far."""
        return frozenset(self._names[self._found])

    def look(self, pose: PoseRow, speed: float) -> None:
        """Call it at each tick: the robot's first link is at `pose`, and no part of the robot is
        faster than `speed` (m/s).
        """
        if not len(self._owners):
            return
        margin = SLACK + speed * self._period
        if (
            self._place is None
            or _moved(self._place, pose, self._hull.reach) + margin >= self._free
        ):
            self._look_around_robot(pose, margin)
        self._look_around_models()

    def _look_around_robot(self, pose: PoseRow, margin: float) -> None:
        low, high = self._hull.bounds(Pose(pose[:3], pose[3:]))
        apart = (
            np.maximum(low[:, None] - self._high, self._low - high[:, None]).max(axis=2).min(axis=0)
        )
        near = apart <= margin
        self._place = pose
        self._free = float(apart[~np.isin(self._owners, self._owners[near])].min(initial=math.inf))
        self._find(near)

    def _look_around_models(self) -> None:
        low, high, speed = self._sleep.awake_links()
        if not len(low):
            return
        margin = (SLACK + speed * self._period)[:, None]
        low = low - margin
        high = high + margin
        lowest = low.min(axis=0)
        highest = high.max(axis=0)
        near: Booleans = (self._low <= highest).all(axis=1) & (self._high >= lowest).all(axis=1)
        meets = (low[:, None] <= self._high[near]) & (self._low[near] <= high[:, None])
        near[near] = meets.all(axis=2).any(axis=0)
        self._find(near)

    def _find(self, near: Booleans) -> None:
        """Notes the models of the shapes `near`, and looks at their shapes no more."""
        if not near.any():
            return
        self._found[self._owners[near]] = True
        others = ~self._found[self._owners]
        self._owners = self._owners[others]
        self._low = self._low[others]
        self._high = self._high[others]


def _moved(one: PoseRow, other: PoseRow, reach: float) -> float:
    """How far any point within `reach` (m) of the origin can have moved between two poses of
    it, m.
    """
    return math.dist(one[:3], other[:3]) + angle_between(one[3:], other[3:]) * reach


ENDLESS = 1e9  # m; half of a box that holds the world


@dataclass(frozen=True)
class Hull:
    """B boxes in the frame of the robot's first link, with `centers` and `halves` (B, 3) m: the
    robot is always inside them.

    No point of a box is farther than `reach` (m) from the frame's origin. A robot with loose parts
    or with unlimited sliding joints has a box of `ENDLESS` (m).
    """

    centers: Floats
    halves: Floats
    reach: float

    @classmethod
    def of(cls, robot: Model) -> Hull:
        low, high = stacked(_boxes(robot))
        centers = (low + high) / 2
        halves = (high - low) / 2
        return cls(
            centers,
            halves,
            float(np.linalg.norm(np.abs(centers) + halves, axis=1).max(initial=0.0)),
        )

    def bounds(self, place: Pose) -> Bounds:
        """The corners (B, 3) m and (B, 3) m of boxes along the world's axes around the boxes, with
        the first link at `place`.
        """
        turn = place.rotation()
        centers = self.centers @ turn.T + np.array(place.position)
        halves = self.halves @ np.abs(turn).T
        return centers - halves, centers + halves


def _boxes(robot: Model) -> Iterator[Bounds]:
    """The box around each link, wherever its joints take it."""
    frame = robot.links[0].pose.inverse()
    first = robot.links[0].pose.position
    # For each link that joints connect with the first one: its joint's place, and the distance
    # there along the joints, m.
    chains = {robot.links[0].name: (first, 0.0)}
    # A file may name its joints in any order.
    for _ in robot.joints:
        for joint in robot.joints:
            if joint.parent in chains and joint.child not in chains:
                start, length = chains[joint.parent]
                place = joint.pose.position
                chains[joint.child] = place, length + math.dist(start, place) + _slide(joint)
    rigid = held_with(robot, robot.links[0].name)
    joint_of = {joint.child: joint for joint in robot.joints}
    for link in robot.links:
        box = bounds(link.collisions, frame if link.name in rigid else link.pose.inverse())
        if box is None:
            continue
        if link.name in rigid:
            yield box
            continue
        held = joint_of.get(link.name)
        if held is not None and held.parent in rigid:
            center = held.pose.position
            far = _slide(held)
        else:
            # Several joints in a row: a ball around the first link.
            center = first
            far = chains[link.name][1] if link.name in chains else math.inf
        start = held.pose.position if held is not None else link.pose.position
        corner = float(np.linalg.norm(np.abs(box).max(axis=0)))
        far = min(ENDLESS, far + math.dist(start, link.pose.position) + corner)
        middle = np.array((frame @ Pose(center)).position)
        yield middle - far, middle + far


def _slide(joint: Joint) -> float:
    """How far `joint` moves its child along its axis, m."""
    if joint.kind == "prismatic":
        return max(abs(joint.lower), abs(joint.upper))
    return 0.0
