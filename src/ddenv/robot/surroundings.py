"""What of a world a robot can notice, worked out once for all runs."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import OutputPort

from ddenv.robot.drake.articulation import anchored
from ddenv.robot.drake.plant import Built
from ddenv.robot.drake.shapes import solid_bounds
from ddenv.world.extent import Bounds, bounds
from ddenv.world.model import Collision, Joint, Model, Plane, World
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


# Room for how far surfaces sink into each other, and joints go beyond their limits, m.
YIELD = 0.1


@dataclass(frozen=True)
class Surroundings:
    """One robot in one world.

    `contacts` are those of the plant. `robot` are the numbers of the robot's geometries, `owners` tells the model by the
    numbers of all others. The robot touches nothing that is more than `reach` (m) away from the origin of its first link.
    `names` (N,) are the models with something that never moves, and `low` and `high` (N, 3) the boxes around that, m; a model
    that is a ground has one more, without end and not `visible` (N,).
    """

    contacts: OutputPort
    robot: frozenset[int]
    owners: dict[int, str]
    reach: float
    names: np.ndarray
    low: np.ndarray
    high: np.ndarray
    visible: np.ndarray

    @classmethod
    def of(cls, world: World, robot: Model, built: Built) -> Surroundings:
        geometry = [*built.static.items(), *((name, body.geometry) for name, body in built.moving.items())]
        boxes = [(model.name, *box) for model in world.models for box in _boxes(model)]
        return cls(
            contacts=built.plant.get_contact_results_output_port(),
            robot=frozenset(one.get_value() for one in built.robot.geometry),
            owners={one.get_value(): name for name, members in geometry for one in members},
            reach=reach(robot) + YIELD,
            names=np.array([name for name, *_ in boxes], dtype=object),
            low=np.array([low for _, low, _, _ in boxes]).reshape(-1, 3),
            high=np.array([high for _, _, high, _ in boxes]).reshape(-1, 3),
            visible=np.array([visible for *_, visible in boxes], dtype=bool),
        )


def _boxes(model: Model) -> Iterator[tuple[np.ndarray, np.ndarray, bool]]:
    """Lowest and highest corner of what never moves of a model, and whether a robot can see it."""
    held = anchored(model)
    links = [link for link in model.links if model.static or link.name in held]
    collisions = tuple(collision for link in links for collision in link.collisions)
    if (box := bounds(collisions)) is not None:
        yield *box, True
    for collision in collisions:
        if isinstance(collision.shape, Plane):
            yield *_below(collision), False


def _below(plane: Collision) -> Bounds:
    """The box around all that is below `plane`."""
    low, high = np.full(3, -np.inf), np.full(3, np.inf)
    if plane.pose.rotation()[2, 2] > 1 - 1e-9:
        high[2] = plane.pose.position[2]
    return low, high
