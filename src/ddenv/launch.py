"""Starting things: a new run file from a scenario, and the programs that work beside a view (the engine, the scene)."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import platformdirs

from ddenv.errors import UserError
from ddenv.runfile.store import RunFile, create
from ddenv.world.model import Model, World
from ddenv.world.placement import check_spawn
from ddenv.world.read import parse_model, parse_world, read_model, read_world
from ddenv.world.scenario import Scenario

SUFFIX = ".ddenv"


def runs_folder() -> Path:
    """Where runs are kept unless a path is given: `$DDENV_HOME/runs`, or the user's data folder."""
    home = os.environ.get("DDENV_HOME")
    return (Path(home) if home else Path(platformdirs.user_data_dir("ddenv", appauthor=False))) / "runs"


def find_run(name: str) -> Path:
    """The run file called `name`, a path or a name in the runs folder."""
    path = Path(name)
    if path.exists() or path.suffix == SUFFIX or len(path.parts) > 1:
        return path
    return runs_folder() / f"{name}{SUFFIX}"


def free_run_path(scenario_name: str) -> Path:
    """The first free name-1, name-2, ... in the runs folder."""
    stem = "".join(char if char.isalnum() or char in "-_" else "-" for char in scenario_name)
    number = 1
    while (path := runs_folder() / f"{stem}-{number}{SUFFIX}").exists():
        number += 1
    return path


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


def create_run(scenario: Scenario, path: Path) -> None:
    """Writes a new run file that holds all a reduction needs. Raises UserError, with nothing written."""
    world, robot = load_parts(scenario)
    documents = {
        "scenario": scenario.model_dump_json().encode(),
        "world": world.text,
        "robot": scenario.robot.model.read_bytes(),
        "elements": json.dumps(world.elements(frozenset(scenario.protected))).encode(),
    }
    assert robot.links
    create(path, documents)


def read_parts(run: RunFile) -> tuple[Scenario, World, Model]:
    """What a run file was made from: its scenario, its world and its robot."""
    try:
        scenario = Scenario.model_validate_json(run.document("scenario"))
    except ValueError:
        raise UserError(f"{run.path}: damaged run file: its scenario is not valid") from None
    world = parse_world(run.document("world"), scenario.world)
    robot = parse_model(run.document("robot"), scenario.robot.model)
    return scenario, world, robot


def start_engine(run: Path, jobs: int, **options: Any) -> subprocess.Popen:
    """Starts the engine on a run as a program in its own session, so that it outlives this terminal.

    Its output goes to a log beside the run file. `options` become `--name value` on its command line.
    """
    words = [sys.executable, "-m", "ddenv.engine", str(run), "--jobs", str(jobs)]
    for name, value in options.items():
        words += [f"--{name.replace('_', '-')}", str(value)]
    with run.with_name(f"{run.name}.log").open("ab") as log:
        return subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True)


def start_scene(run: Path, port: int = 0) -> subprocess.Popen:
    """Starts the scene program on a run; its first line of output is the URL it serves on 127.0.0.1."""
    words = [sys.executable, "-m", "ddenv.scene", str(run), "--port", str(port)]
    with run.with_name(f"{run.name}.scene.log").open("ab") as log:
        return subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log, text=True)
