"""Checks that the robot can start where a scenario says: no part of it may overlap a model."""

from __future__ import annotations

import numpy as np

from ddenv.errors import UserError
from ddenv.world.extent import Bounds, shape_bounds
from ddenv.world.model import Collision, Mesh, Model, Plane, World
from ddenv.world.overlap import Hull, hull, overlap
from ddenv.world.pose import Pose
from ddenv.world.scenario import Spawn

# Tolerated overlap, m: contacts at rest overlap slightly, and numbers in files are rounded.
TOLERANCE = 0.02


def spawn_pose(spawn: Spawn) -> Pose:
    """The pose of the robot's model frame in the world at the start."""
    return Pose.from_rpy(spawn.x, spawn.y, spawn.z, 0.0, 0.0, spawn.yaw)


def check_spawn(world: World, robot: Model, spawn: Spawn) -> None:
    """Raises UserError if the robot, placed at `spawn`, stands inside a model or below the ground."""
    place = spawn_pose(spawn) @ robot.pose.inverse()
    solid = [collision for collision in robot.collisions if not isinstance(collision.shape, Plane)]
    if not solid:
        raise UserError(f"robot.model: '{robot.name}' has no collision shapes")
    bodies = [hull(collision, place) for collision in solid]
    boxes = [shape_bounds(collision.shape, place @ collision.pose) for collision in solid]
    where = f"spawn ({spawn.x:g}, {spawn.y:g}, {spawn.z:g})"
    for model in world.models:
        depths = [(_depth_inside(bodies, boxes, collision), collision.shape) for collision in model.collisions]
        depth, shape = max(depths, key=lambda each: each[0], default=(0.0, None))
        if depth > TOLERANCE:
            # The hull of a hollow mesh fills space that looks free.
            what = "the convex hull of model" if isinstance(shape, Mesh) else "model"
            raise UserError(
                f"{where}: the robot stands inside {what} '{model.name}' by {depth:.2f} m; move the spawn or raise its z"
            )


def _depth_inside(bodies: list[Hull], boxes: list[Bounds], collision: Collision) -> float:
    """How deep the robot's `bodies`, with `boxes` around them, overlap an obstacle, m."""
    if isinstance(collision.shape, Plane):
        up = np.array([collision.pose.rotate((0.0, 0.0, 1.0))])
        height = float(up[0] @ collision.pose.position)
        return max(height - float(body.span(up)[0][0]) for body in bodies)
    low, high = shape_bounds(collision.shape, collision.pose)
    near = [
        body for body, (bottom, top) in zip(bodies, boxes, strict=True) if (bottom <= high).all() and (top >= low).all()
    ]
    if not near:
        return 0.0
    obstacle = hull(collision)
    return max(overlap(body, obstacle) for body in near)
