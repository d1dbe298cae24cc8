"""Scenarios put together from what a user gives: an SDF world with two places, or options over a scenario file."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ddenv.errors import UserError
from ddenv.schemas import nearest
from ddenv.settings import SETTINGS, Ignorable, Value, put
from ddenv.world.access import read_bytes
from ddenv.world.command import command_words
from ddenv.world.load import SDF, validate
from ddenv.world.model import Model, World
from ddenv.world.placement import check_spawn
from ddenv.world.scenario import PLAIN, Reading, Scenario
from ddenv.world.sdf.read import disk_of, parse_model, read_world
from ddenv.world.sdf.standin import parse_option


def reading_of(
    reading: Reading = PLAIN,
    *,
    model_path: Sequence[Path] = (),
    stand_in: Sequence[str] = (),
    ignore: Sequence[Ignorable] = (),
) -> Reading:
    """`reading` with more folders (searched first), stand-ins (`URI=SHAPE`) and ignored kinds of elements. Raises UserError."""
    for folder in model_path:
        if not folder.is_dir():
            raise UserError(f"--model-path: there is no folder {folder}")
    folders = (*(folder.resolve() for folder in model_path), *reading.model_path)
    stand_ins = reading.stand_ins | dict(parse_option(option) for option in stand_in)
    ignored = dict.fromkeys((*reading.ignore, *ignore))
    return Reading(model_path=folders, stand_ins=stand_ins, ignore=tuple(ignored))


def scenario_for_world(world: Path, spawn: tuple[float, float, float, float], goal: tuple[float, float]) -> Scenario:
    """A scenario for the bundled robot in any SDF world: `spawn` x, y, z m and yaw rad, `goal` x, y m. Raises UserError."""
    data = {
        "name": world.stem[:80] or "world",
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
    spawn: Sequence[float] | None = None,
    goal: Sequence[float] | None = None,
    world: Path | None = None,
    reading: Reading | None = None,
    **values: Value,
) -> Scenario:
    """`scenario` with some of its settings replaced; those that are None stay. Raises UserError.

    `spawn` is x, y, z m and yaw rad (0 if left out), `goal` x, y m. `values` are settings by name; 0 takes back a limit.
    """
    given = {name: value for name, value in values.items() if value is not None}
    for name, value in given.items():
        if name in SETTINGS and (value or not SETTINGS[name].none):
            SETTINGS[name].check(value)
    chosen = with_values(scenario.model_dump(mode="json"), given)
    if spawn is not None:
        chosen["robot"]["spawn"] = dict(zip(("x", "y", "z", "yaw"), spawn, strict=False))
    if goal is not None:
        chosen["goal"].update(zip(("x", "y"), goal, strict=True))
    if world is not None:
        chosen["world"] = str(world.resolve())
    if reading is not None:
        chosen["reading"] = reading.model_dump(mode="json")
    named = {SETTINGS[name].key: SETTINGS[name].option for name in given if SETTINGS[name].option}
    places = (("--spawn", "robot.spawn", spawn), ("--goal", "goal", goal))
    named |= {f"{key}.{axis}": option for option, key, place in places if place for axis in ("x", "y", "z", "yaw")}
    return validate(chosen, "options", named)


def with_values(data: dict[str, Any], values: Mapping[str, Value]) -> dict[str, Any]:
    """A scenario as plain data, with settings replaced by name; None or 0 takes back a limit. Raises UserError."""
    for name in values:
        if name not in SETTINGS:
            raise UserError(f"options: no setting '{name}'{nearest(name, list(SETTINGS))}")
    # A setting that sets several others comes first, so that each of these may be given, too.
    for name in sorted(values, key=lambda each: SETTINGS[each].stored):
        put(data, SETTINGS[name], (values[name] or None) if SETTINGS[name].none else values[name])
    return data


def load_parts(scenario: Scenario, announce: Callable[[str], None] | None = None) -> tuple[World, Model]:
    """The world and the robot of a scenario, checked against each other; the world's `resources` are those of both.

    Calls `announce` with a line before slow steps. Raises UserError.
    """
    if scenario.oracle is not None:
        command_words(scenario)
    reading, robot_file = scenario.reading, scenario.robot.model
    world = read_world(scenario.world, reading, announce)
    around_robot = disk_of(robot_file, reading, announce)
    robot = parse_model(read_bytes(robot_file), robot_file, reading, around_robot)
    world = replace(world, resources={**world.resources, **around_robot.taken})
    check_parts(scenario, world, robot)
    return world, robot


def check_parts(scenario: Scenario, world: World, robot: Model) -> None:
    """Whether a scenario fits its world and its robot. Raises UserError."""
    known = {model.name for model in world.models}
    for name in scenario.protected:
        if name not in known:
            raise UserError(f"protected: the world {scenario.world} has no model '{name}'")
    if not world.elements(frozenset(scenario.protected)):
        raise UserError(f"{scenario.world}: has no model that can be removed")
    check_spawn(world, robot, scenario.robot.spawn)
