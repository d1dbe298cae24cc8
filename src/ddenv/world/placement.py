"""Whether the robot can start where a scenario says: no part of it may stand inside a model."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ddenv.errors import UserError
from ddenv.world.model import Box, Collision, Cylinder, Model, Plane, Sphere, World
from ddenv.world.pose import Pose
from ddenv.world.scenario import Spawn

# Contacts rest with a little overlap, and a file's numbers are rounded: less than this is no complaint, m.
TOLERANCE = 0.02
# A cylinder is taken as a prism with this many sides.
SIDES = 16


@dataclass(frozen=True)
class Hull:
    """A convex body: `vertices` (N, 3) m grown by `radius` m; `normals` and `edges` are directions, shape (M, 3)."""

    vertices: np.ndarray
    normals: np.ndarray
    edges: np.ndarray
    radius: float = 0.0

    def span(self, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest coordinate along each unit vector of `axes`, shape (M, 3)."""
        along = self.vertices @ axes.T
        return along.min(axis=0) - self.radius, along.max(axis=0) + self.radius


def spawn_pose(spawn: Spawn) -> Pose:
    """The robot's model frame in the world at the start."""
    return Pose.from_rpy(spawn.x, spawn.y, spawn.z, 0.0, 0.0, spawn.yaw)


def check_spawn(world: World, robot: Model, spawn: Spawn) -> None:
    """Raises UserError if the robot, placed at `spawn`, stands inside a model or below the ground."""
    place = spawn_pose(spawn) @ robot.pose.inverse()
    bodies = [hull(collision, place) for collision in robot.collisions]
    if not bodies:
        raise UserError(f"robot.model: '{robot.name}' has no collision shapes")
    low = np.min([body.span(np.eye(3))[0] for body in bodies], axis=0)
    high = np.max([body.span(np.eye(3))[1] for body in bodies], axis=0)
    where = f"robot.spawn ({spawn.x:g}, {spawn.y:g}, {spawn.z:g})"
    for model in world.models:
        for collision in model.collisions:
            if isinstance(collision.shape, Plane):
                depth = collision.pose.position[2] - low[2]
            else:
                depth = _depth(bodies, hull(collision), low, high)
            if depth > TOLERANCE:
                raise UserError(
                    f"{where}: the robot stands inside model '{model.name}' by {depth:.2f} m; move the spawn or raise its z"
                )


def _depth(bodies: list[Hull], obstacle: Hull, low: np.ndarray, high: np.ndarray) -> float:
    bottom, top = obstacle.span(np.eye(3))
    if np.any(bottom > high) or np.any(top < low):
        return 0.0
    return max(overlap(body, obstacle) for body in bodies)


def hull(collision: Collision, place: Pose | None = None) -> Hull:
    """The convex body of a collision shape that is no plane, moved by `place`."""
    pose = collision.pose if place is None else place @ collision.pose
    shape, rotation = collision.shape, pose.rotation().T
    if isinstance(shape, Sphere):
        return Hull(np.array([pose.position]), np.empty((0, 3)), np.empty((0, 3)), shape.radius)
    if isinstance(shape, Box):
        corners = np.array(np.meshgrid([-0.5, 0.5], [-0.5, 0.5], [-0.5, 0.5])).reshape(3, -1).T * shape.size
        return Hull(corners @ rotation + pose.position, rotation, rotation)
    assert isinstance(shape, Cylinder)
    angles = np.arange(SIDES) * 2 * math.pi / SIDES
    rim = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(SIDES)])
    up = np.array([[0.0, 0.0, 1.0]])
    vertices = np.vstack([shape.radius * rim + side * shape.length / 2 * up for side in (-1, 1)])
    directions = np.vstack([rim, up]) @ rotation
    return Hull(vertices @ rotation + pose.position, directions, directions)


def overlap(a: Hull, b: Hull) -> float:
    """How deep two convex bodies stand in each other, m; 0 where they are apart (separating axes)."""
    crosses = np.cross(a.edges[:, None, :], b.edges[None, :, :]).reshape(-1, 3)
    axes = np.vstack([a.normals, b.normals, crosses, _towards(a, b), _towards(b, a)])
    lengths = np.linalg.norm(axes, axis=1)
    axes = axes[lengths > 1e-9] / lengths[lengths > 1e-9, None]
    if not len(axes):
        return a.radius + b.radius
    a_low, a_high = a.span(axes)
    b_low, b_high = b.span(axes)
    return max(0.0, float(np.min(np.minimum(a_high - b_low, b_high - a_low))))


def _towards(a: Hull, b: Hull) -> np.ndarray:
    """A round body needs one axis more: from its centre to the other's nearest vertex."""
    if a.radius == 0.0:
        return np.empty((0, 3))
    away = b.vertices - a.vertices[0]
    return away[[np.argmin(np.linalg.norm(away, axis=1))]]
