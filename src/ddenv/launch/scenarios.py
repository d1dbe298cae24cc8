"""Scenarios put together from what a user gives: an SDF world with two places, or options over a scenario file."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from ddenv.errors import UserError
from ddenv.world.bundled import SDF
from ddenv.world.load import validate
from ddenv.world.model import Model, World
from ddenv.world.placement import check_spawn
from ddenv.world.read import read_model, read_world
from ddenv.world.scenario import Scenario


def scenario_for_world(world: Path, spawn: tuple[float, float, float, float], goal: tuple[float, float]) -> Scenario:
    """A scenario for the bundled robot in any SDF world: `spawn` x, y, z m and yaw rad, `goal` x, y m. Raises UserError."""
    data = {
        "name": world.stem or "world",
        "world": str(world.resolve()),
        "robot": {
            "model": str(SDF / "robots" / "husky.sdf"),
            "spawn": dict(zip(("x", "y", "z", "yaw"), spawn, strict=True)),
        },
        "goal": dict(zip(("x", "y"), goal, strict=True)),
    }
    return validate(data, str(world))


def with_options(
    scenario: Scenario,
    *,
    pair: str | None = None,
    iterations: int | None = None,
    n_partitions: int | None = None,
    seed: int | None = None,
    timeout: float | None = None,
    epsilon: float | None = None,
    spawn: Sequence[float] | None = None,
    goal: Sequence[float] | None = None,
    world: Path | None = None,
) -> Scenario:
    """`scenario` with some of its settings replaced. Raises UserError.

    `timeout` is in simulated s, `epsilon` in m, `spawn` x, y, z m and yaw rad (0 if left out), `goal` x, y m.
    """
    data = scenario.model_dump(mode="json")
    reduction = {"pair": pair, "iterations": iterations, "n_partitions": n_partitions, "seed": seed}
    failure = {"timeout": timeout, "epsilon": epsilon}
    data["reduction"].update({key: value for key, value in reduction.items() if value is not None})
    data["failure"].update({key: value for key, value in failure.items() if value is not None})
    if spawn is not None:
        data["robot"]["spawn"] = dict(zip(("x", "y", "z", "yaw"), spawn, strict=False))
    if goal is not None:
        data["goal"].update(zip(("x", "y"), goal, strict=True))
    if world is not None:
        data["world"] = str(world.resolve())
    return validate(data, "options")


def load_parts(scenario: Scenario) -> tuple[World, Model]:
    """The world and the robot of a scenario, checked against each other. Raises UserError."""
    world, robot = read_world(scenario.world), read_model(scenario.robot.model)
    known = {model.name for model in world.models}
    for name in scenario.protected:
        if name not in known:
            raise UserError(f"protected: the world {scenario.world} has no model '{name}'")
    if not world.elements(frozenset(scenario.protected)):
        raise UserError(f"{scenario.world}: has no model that could be removed")
    check_spawn(world, robot, scenario.robot.spawn)
    return world, robot
