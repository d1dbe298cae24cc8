"""Worlds and scenarios for runs of the robot on the real simulator."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from ddenv.robot.result import RunResult
from ddenv.robot.simulation.plant_cache import Plant
from ddenv.world.load import SCENARIOS, SDF, load_scenario, validate
from ddenv.world.model import Box, Collision, Inertia, Joint, Link, Mesh, Model, Shape, World
from ddenv.world.pose import Pose, Vector
from ddenv.world.scenario import Scenario
from ddenv.world.sdf.read import parse_world, read_model, read_world

GROUND = (
    '<model name="ground"><static>true</static><link name="link"><collision '
    'name="c"><geometry><plane>'
    "<normal>0 0 1</normal></plane></geometry></collision></link></model>"
)


def box_model(name: str, pose: str, size: str, mass: float | None = None, mu: float = 1.0) -> str:
    """A box in SDF, static unless it has a mass (kg)."""
    inertial, static = "", "<static>true</static>"
    if mass is not None:
        x, y, z = (float(word) for word in size.split())
        static = ""
        inertial = (
            f"<inertial><mass>{mass}</mass><inertia><ixx>{mass * (y * y + z * z) / 12}</ixx>"
            f"<iyy>{mass * (x * x + z * z) / 12}</iyy><izz>{mass * (x * x + y * y) / 12}</izz></inertia></inertial>"
        )
    return (
        f'<model name="{name}">{static}<pose>{pose}</pose><link name="link">{inertial}<collision '
        'name="c"><geometry><box>'
        f"<size>{size}</size></box></geometry><surface><friction><ode><mu>{mu}</mu></ode></friction></surface></collision>"
        "</link></model>"
    )


def link_of(
    name: str, shape: Shape | None, pose: Pose, mass: float | None = 1.0, mu: float = 1.0
) -> Link:
    """A link of one shape; its inertia is about that of a box of 0.4 m."""
    moments = (0.03 * mass,) * 3 if mass else (0.0, 0.0, 0.0)
    collisions = (Collision(name="c", shape=shape, pose=pose, mu=mu),) if shape else ()
    return Link(
        name=name,
        pose=pose,
        inertia=Inertia(mass, pose, moments) if mass else None,
        collisions=collisions,
        visuals=(),
    )


def joint_of(
    kind: str,
    parent: str,
    child: str,
    at: Vector,
    axis: Vector = (0.0, 0.0, 1.0),
    **changes: object,
) -> Joint:
    """An unlimited joint `at` a place in the world, with changes to its fields."""
    joint = Joint(
        name=f"{parent}_{child}",
        kind=kind,
        parent=parent,
        child=child,
        pose=Pose(at),
        axis=axis,
        lower=-np.inf,
        upper=np.inf,
        effort=np.inf,
        velocity=np.inf,
        damping=0.0,
    )
    return replace(joint, **changes)


def model_of(name: str, *links: Link, joints: tuple[Joint, ...] = (), **changes: object) -> Model:
    """A model made of `links`, static if the first has no mass."""
    static = links[0].inertia is None
    return replace(
        Model(
            name=name,
            pose=links[0].pose,
            static=static,
            links=links,
            joints=joints,
            spans=(),
            line=1,
        ),
        **changes,
    )


def cube(
    name: str,
    x: float,
    y: float,
    z: float = 0.15,
    side: float = 0.3,
    mass: float | None = 1.0,
    **changes: object,
) -> Model:
    return model_of(
        name, link_of("link", Box((side, side, side)), Pose((x, y, z)), mass), **changes
    )


def door(name: str, x: float, y: float, **changes: object) -> Model:
    """A door leaf of 1 m whose hinge stands on its left."""
    leaf = link_of("leaf", Box((0.05, 1.0, 0.8)), Pose((x, y, 0.6)), mass=3.0)
    return model_of(
        name, leaf, joints=(joint_of("revolute", "world", "leaf", (x, y + 0.5, 0.6), **changes),)
    )


def run(template: Plant, *names: str, seed: int = 1) -> RunResult:
    return template.run(frozenset(names), seed)


def bits(result: RunResult, *left_out: str) -> tuple:
    """All of a run, but for how these models moved and what was noticed."""
    motions = {
        name: rows.tobytes() for name, rows in result.motions.items() if name not in left_out
    }
    return result.outcome, result.failure, result.trajectory.tobytes(), motions


def noticed(result: RunResult) -> tuple[dict[str, float], dict[str, float]]:
    return result.first_sensed, result.first_touched


def all_bits(result: RunResult) -> tuple:
    return *bits(result), noticed(result)


def wedge(width: float, depth: float, height: float) -> Mesh:
    """A ramp up along x, with its lowest corner in the origin's place and its back upright."""
    x, y, z = depth / 2, width / 2, height / 2
    vertices = [(-x, -y, -z), (x, -y, -z), (x, y, -z), (-x, y, -z), (x, -y, z), (x, y, z)]
    faces = [(0, 2, 1), (0, 3, 2), (1, 2, 5), (1, 5, 4), (0, 5, 3), (0, 4, 5), (0, 1, 4), (3, 5, 2)]
    # Meshes of one name count as one.
    return Mesh(f"wedge {width} {depth} {height}", np.array(vertices), np.array(faces))


@pytest.fixture(scope="session")
def add() -> Callable[..., World]:
    """A world with more models."""
    return lambda world, *models: replace(world, models=world.models + models)


@pytest.fixture(scope="session")
def box() -> Callable[..., str]:
    return box_model


@pytest.fixture(scope="session")
def husky() -> Model:
    return read_model(SDF / "robots" / "husky.sdf")


@pytest.fixture(scope="session")
def scenario_of() -> Callable[..., Scenario]:
    """A scenario that starts in the origin of a flat world and drives along x, with changes to its
    sections.
    """

    def make(**sections: dict) -> Scenario:
        data = {
            "name": "test",
            "world": "world.sdf",
            "robot": {"model": "husky.sdf", "spawn": {"x": 0, "y": 0, "z": 0.14}},
            "goal": {"x": 3.0, "y": 0.0, "tolerance": 0.5},
            "failure": {"timeout": 10.0},
        }
        return validate(data | sections, "test")

    return make


@pytest.fixture(scope="session")
def world_of() -> Callable[..., World]:
    """The world made of these models in SDF, with a ground unless `ground` is False."""

    def make(*models: str, ground: bool = True) -> World:
        text = (
            '<sdf version="1.9"><world '
            f'name="w">{GROUND if ground else ""}{"".join(models)}</world></sdf>'
        )
        return parse_world(text.encode(), Path("world.sdf"))

    return make


@pytest.fixture(scope="session")
def ditch_scenario() -> Scenario:
    return load_scenario(SCENARIOS / "ditch.yaml")


@pytest.fixture(scope="session")
def ditch_world(ditch_scenario: Scenario) -> World:
    return read_world(ditch_scenario.world)


@pytest.fixture(scope="session")
def ditch(ditch_world: World, husky: Model, ditch_scenario: Scenario) -> Plant:
    return Plant(ditch_world, husky, ditch_scenario)
