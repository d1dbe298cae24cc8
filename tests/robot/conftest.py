"""Worlds and scenarios for runs of the robot on the real simulator."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest

from ddenv.robot.template import Template
from ddenv.world.bundled import SCENARIOS, SDF
from ddenv.world.load import load_scenario, validate
from ddenv.world.model import Model, World
from ddenv.world.read import parse_world, read_model, read_world
from ddenv.world.scenario import Scenario

GROUND = (
    '<model name="ground"><static>true</static><link name="link"><collision name="c"><geometry><plane>'
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
        f'<model name="{name}">{static}<pose>{pose}</pose><link name="link">{inertial}<collision name="c"><geometry><box>'
        f"<size>{size}</size></box></geometry><surface><friction><ode><mu>{mu}</mu></ode></friction></surface></collision>"
        "</link></model>"
    )


@pytest.fixture(scope="session")
def box() -> Callable[..., str]:
    return box_model


@pytest.fixture(scope="session")
def husky() -> Model:
    return read_model(SDF / "robots" / "husky.sdf")


@pytest.fixture(scope="session")
def scenario_of() -> Callable[..., Scenario]:
    """A scenario that starts in the origin of a flat world and drives along x, with changes to its sections."""

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
        text = f'<sdf version="1.9"><world name="w">{GROUND if ground else ""}{"".join(models)}</world></sdf>'
        return parse_world(text.encode(), Path("world.sdf"))

    return make


@pytest.fixture(scope="session")
def ditch_scenario() -> Scenario:
    return load_scenario(SCENARIOS / "ditch.yaml")


@pytest.fixture(scope="session")
def ditch_world(ditch_scenario: Scenario) -> World:
    return read_world(ditch_scenario.world)


@pytest.fixture(scope="session")
def ditch(ditch_world: World, husky: Model, ditch_scenario: Scenario) -> Template:
    return Template(ditch_world, husky, ditch_scenario)
