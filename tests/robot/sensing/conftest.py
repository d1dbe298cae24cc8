"""Worlds of a few shapes, and lidars in them."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import numpy as np

from ddenv.robot.protocol import Scan
from ddenv.robot.sensing.beams import Obstacles
from ddenv.robot.sensing.lidar import Lidar
from ddenv.world import scenario
from ddenv.world.model import Model, Shape, World
from ddenv.world.pose import Pose
from tests.robot.conftest import link_of, model_of


def still(name: str, shape: Shape, pose: Pose) -> Model:
    """A static model of one shape."""
    return model_of(name, link_of("link", shape, pose, mass=None))


def loose(name: str, shape: Shape, pose: Pose) -> Model:
    """A model of one shape that can move, with its link's frame in the shape's middle."""
    return model_of(name, link_of("link", shape, pose))


def obstacles_of(*models: Model) -> Obstacles:
    return Obstacles.of(
        World(
            path=Path("world.sdf"), name="world", text=b"", gravity=(0.0, 0.0, -9.81), models=models
        )
    )


def plain(**settings: float) -> scenario.Lidar:
    """A lidar in the robot's origin and without noise, with changes to that."""
    return scenario.Lidar(**{"x": 0.0, "z": 0.0, "noise": 0.0} | settings)


def lidar_of(
    *models: Model,
    settings: scenario.Lidar | None = None,
    present: Iterable[str] | None = None,
    seed: int = 0,
) -> Lidar:
    """A lidar in the world of `models`, of which all or only those `present` are there."""
    names = frozenset(model.name for model in models) if present is None else frozenset(present)
    moving = [model for model in models if not model.static and model.name in names]
    return Lidar(
        settings or plain(), obstacles_of(*models), names, moving, np.random.default_rng(seed)
    )


def scan(lidar: Lidar, robot: Pose | None = None, *links: Pose, now: float = 0.0) -> Scan:
    """One scan with the robot and the moving links at these poses."""
    robot = robot or Pose()
    places = np.array([pose.position for pose in links]).reshape(-1, 3)
    turns = np.array([pose.rotation() for pose in links]).reshape(-1, 3, 3)
    return lidar.scan(now, (*robot.position, *robot.quaternion), places, turns)
