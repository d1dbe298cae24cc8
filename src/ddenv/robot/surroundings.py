"""What of a world a robot can notice, worked out once for all runs."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from pydrake.systems.framework import OutputPort

from ddenv.robot.joints import anchored
from ddenv.robot.plant import Built
from ddenv.robot.reach import reach
from ddenv.world.extent import Bounds, bounds
from ddenv.world.model import Collision, Model, Plane, World

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
