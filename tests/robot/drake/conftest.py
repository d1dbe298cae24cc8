"""The Husky on a road, and what may lie ahead of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from ddenv.robot.result import RunResult
from ddenv.robot.simulation.plant_cache import Plant
from ddenv.world.model import Box, Collision, Link, Model, Shape, World
from ddenv.world.pose import HERE, Pose

WIDTH = 6.0  # of the road, m
EDGE = 1.5  # where the road ends, m ahead of the robot
ROAD = Box((6.0, WIDTH, 0.1))


def piece(name: str, shape: Shape, pose: Pose) -> Collision:
    return Collision(name=name, shape=shape, pose=pose, mu=1.0)


def static(name: str, *collisions: Collision) -> Model:
    return Model(
        name=name,
        pose=Pose(),
        static=True,
        links=(Link(name="link", pose=Pose(), inertia=None, collisions=collisions, visuals=()),),
        joints=(),
        spans=(),
        line=1,
    )


@pytest.fixture(scope="session")
def drive(world_of, husky, scenario_of) -> Callable[..., RunResult]:
    """A run of the Husky from the origin of `frame`, over the road and onto what lies ahead."""

    def run(
        *models: Model,
        frame: Pose = HERE,
        robot: Model = husky,
        speed: float = 0.5,
        timeout: float = 12.0,
    ) -> RunResult:
        start = frame @ Pose((0.0, 0.0, 0.14))
        goal = frame @ Pose((3.0, 0.0, 0.0))
        x, y, z = start.position
        scenario = scenario_of(
            robot={"model": "husky.sdf", "spawn": {"x": x, "y": y, "z": z, "yaw": frame.yaw()}},
            goal={"x": goal.position[0], "y": goal.position[1], "tolerance": 0.3},
            controller={"speed": speed, "motor_gain": 300.0},
            failure={"timeout": timeout},
        )
        road = static("road", piece("road", ROAD, frame @ Pose((EDGE - 3.0, 0.0, -0.05))))
        world: World = replace(world_of(ground=False), models=(road, *models))
        return Plant(world, robot, scenario).run(
            frozenset(model.name for model in world.models), seed=1
        )

    return run
