"""How high the robot stands at a place that was picked on the map."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from ddenv.world.model import Model, World

# Wheels that begin in the ground would throw the robot.
ABOVE = 0.02


def support(world: World, x: float, y: float) -> float | None:
    """The highest top of what stands at (x, y), m: of the boxes around the shapes there. None where there is nothing."""
    from ddenv.world.extent import shape_bounds
    from ddenv.world.model import Plane

    tops = []
    for model in world.models:
        for collision in model.collisions:
            if isinstance(collision.shape, Plane):
                tops.append(float(collision.pose.position[2]))
                continue
            low, high = shape_bounds(collision.shape, collision.pose)
            if low[0] <= x <= high[0] and low[1] <= y <= high[1]:
                tops.append(float(high[2]))
    return max(tops, default=None)


def clearance(robot: Model) -> float:
    """How far the robot's frame is above the ground it stands on, m."""
    from ddenv.world.extent import model_bounds

    box = model_bounds(robot)
    return ABOVE if box is None else ABOVE + float(robot.pose.position[2] - box[0][2])


def spawn_height(world: World, clear: float, x: float, y: float) -> float | None:
    """The z of a spawn at (x, y) for a robot whose frame is `clear` above the ground, m, to the mm; None over nothing."""
    top = support(world, x, y)
    return None if top is None else round(top + clear, 3)
