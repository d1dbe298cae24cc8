"""What of a world the robot can touch or see, computed once for all runs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import OutputPort

from ddenv.arrays import Booleans, Floats, Objects
from ddenv.robot.drake.articulation import anchored
from ddenv.robot.drake.plant import Built
from ddenv.robot.drake.shapes import solid_bounds
from ddenv.world.extent import Bounds, bounds
from ddenv.world.model import Collision, Joint, Model, Plane, World
from ddenv.world.pose import Vector

# A margin for surfaces that sink into each other, and joints that exceed their limits, m.
YIELD = 0.1
# A model, the lowest and the highest corner (3,) m of a box around parts of it that never move, and whether these are visible.
Still = tuple[str, Floats, Floats, bool]


@dataclass(frozen=True)
class Surroundings:
    """One robot in one world.

    `contacts` is the plant's port of contacts. `robot` are the ids of the robot's geometry; `owners` maps the ids of all other
    geometry to the names of its models. The robot touches nothing beyond `reach` (m) from the origin of its first link.

    `names` (N,) are the models with parts that never move, `low` and `high` (N, 3) m the corners of the boxes around those parts. A
    ground model has a second, endless box around all that is below its plane, which is not `visible` (N,).
    """

    contacts: OutputPort
    robot: frozenset[int]
    owners: dict[int, str]
    reach: float
    names: Objects
    low: Floats
    high: Floats
    visible: Booleans

    @classmethod
    def of(cls, boxes: Sequence[Still], robot: Model, built: Built) -> Surroundings:
        geometry = [*built.static.items(), *((name, body.geometry) for name, body in built.moving.items())]
        geometry += [(name, twin.geometry) for name, twin in built.twins.items()]
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


def still_boxes(world: World) -> list[Still]:
    """The boxes around all parts of `world` that never move."""
    return [(model.name, *box) for model in world.models for box in _boxes(model)]


def reach(robot: Model) -> float:
    """An upper bound of the distance (m) from the origin of the robot's first link to any point of its geometry.

    Infinite for a robot with loose parts or with unlimited sliding joints.
    """
    reached = chains(robot)
    farthest = 0.0
    for link in robot.links:
        box = solid_bounds(link.collisions, link.pose.inverse())
        if box is None:
            continue
        if link.name not in reached:
            return math.inf
        start, length = reached[link.name]
        corner = float(np.linalg.norm(np.abs(box).max(axis=0)))
        farthest = max(farthest, length + math.dist(start, link.pose.position) + corner)
    return farthest


def chains(robot: Model) -> dict[str, tuple[Vector, float]]:
    """For each link that joints connect with the first one: its joint's place, and the distance there along the joints, m."""
    chains = {robot.links[0].name: (robot.links[0].pose.position, 0.0)}
    # A file may name its joints in any order.
    for _ in robot.joints:
        for joint in robot.joints:
            if joint.parent in chains and joint.child not in chains:
                start, length = chains[joint.parent]
                chains[joint.child] = (
                    joint.pose.position,
                    length + math.dist(start, joint.pose.position) + slide(joint),
                )
    return chains


def slide(joint: Joint) -> float:
    """How far `joint` moves its child along its axis, m."""
    return max(abs(joint.lower), abs(joint.upper)) if joint.kind == "prismatic" else 0.0


def _boxes(model: Model) -> Iterator[tuple[Floats, Floats, bool]]:
    """The lowest and the highest corner (3,) of each box around the parts of `model` that never move, and if it is visible."""
    held = anchored(model)
    links = [link for link in model.links if model.static or link.name in held]
    collisions = tuple(collision for link in links for collision in link.collisions)
    if (box := bounds(collisions)) is not None:
        yield *box, True
    for collision in collisions:
        if isinstance(collision.shape, Plane):
            yield *_below(collision), False


def _below(plane: Collision) -> Bounds:
    """The box around everything below `plane`."""
    low, high = np.full(3, -np.inf), np.full(3, np.inf)
    if plane.pose.rotation()[2, 2] > 1 - 1e-9:
        high[2] = plane.pose.position[2]
    return low, high
