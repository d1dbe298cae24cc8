"""Starting things: a new run file from a scenario, and the programs that work beside a view (the engine, the scene)."""

from __future__ import annotations

import os
import subprocess
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import platformdirs
import yaml

from ddenv.errors import UserError
from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile, create
from ddenv.world.bundled import SDF
from ddenv.world.load import validate
from ddenv.world.model import Model, World
from ddenv.world.placement import check_spawn
from ddenv.world.read import parse_model, parse_world, read_bytes, read_model, read_world
from ddenv.world.scenario import Scenario
from ddenv.world.write import without, write_file

SUFFIX = ".ddenv"
# How the engine's own lines in its log begin, among whatever libraries print there; and its first one.
ENGINE_SAYS = "ddenv engine:"
ENGINE_STARTED = "started"


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


def run_path(scenario_name: str, name: str | None, output: Path | None) -> Path:
    """Where a new run is written: `output` (a .ddenv file or a folder), or in the runs folder. Raises UserError."""
    if name is not None and (not name.strip() or any(char in name for char in "/\\\0") or name.startswith(".")):
        raise UserError(f"--name: '{name}' cannot be a file's name; use letters, digits, - and _")
    if output is None or output.suffix in (".sdf", ".world"):
        if output is not None and not output.parent.is_dir():
            raise UserError(f"--output: there is no folder {output.parent}")
        return free_run_path(scenario_name) if name is None else runs_folder() / f"{name}{SUFFIX}"
    if output.is_dir():
        return output / f"{name or scenario_name}{SUFFIX}"
    if output.suffix != SUFFIX:
        raise UserError(f"--output: '{output}' is neither a folder nor a {SUFFIX}, .sdf or .world file")
    return output


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
    world, _ = load_parts(scenario)
    documents = {
        "scenario": scenario.model_dump_json().encode(),
        "world": world.text,
        "robot": read_bytes(scenario.robot.model),
    }
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


def export_world(run: Path, sdf: Path, scenario_file: Path | None) -> list[Path]:
    """Writes the environment that a run has left as an SDF world, and a scenario for it; returns what was written."""
    with RunFile(run) as file:
        scenario, world, _ = read_parts(file)
        robot = file.document("robot")
        state = fold(file.events())
    if not state.elements:
        raise UserError(f"{run}: nothing has been run yet; start it with 'ddenv resume {run}'")
    write_file(sdf, without(world, frozenset(state.elements) - frozenset(state.environment)))
    if scenario_file is None:
        return [sdf]
    model = scenario_file.with_suffix(".robot.sdf")
    write_file(model, robot)
    data = scenario.model_dump(mode="json")
    data["world"], data["robot"]["model"] = str(sdf.resolve()), str(model.resolve())
    write_file(scenario_file, yaml.safe_dump(data, sort_keys=False, allow_unicode=True).encode())
    return [sdf, model, scenario_file]


def start_engine(run: Path, jobs: int, **options: Any) -> subprocess.Popen:
    """Starts the engine on a run as a program in its own session, so that it outlives this terminal.

    Its output goes to a log beside the run file. `options` become `--name value` on its command line.
    """
    words = [sys.executable, "-m", "ddenv.engine", str(run), "--jobs", str(jobs), "--since", repr(time.time())]
    for name, value in options.items():
        words += [f"--{name.replace('_', '-')}", str(value)]
    with run.with_name(f"{run.name}.log").open("ab") as log:
        return subprocess.Popen(words, stdin=subprocess.DEVNULL, stdout=log, stderr=log, start_new_session=True)


def last_words(run: Path) -> str:
    """Why the engine that was last started on a run is gone, from its log."""
    log = run.with_name(f"{run.name}.log")
    lines = log.read_text(errors="replace").splitlines() if log.exists() else []
    said = ""
    for line in lines:
        if line.startswith(ENGINE_SAYS):
            said = line.removeprefix(ENGINE_SAYS).strip()
    if said and said != ENGINE_STARTED:
        return said
    return f"{run}: the engine was killed or crashed (see {log}); go on with 'ddenv resume {run}'"


def start_scene(run: Path, port: int = 0) -> subprocess.Popen:
    """Starts the scene program on a run; its first line of output is the URL it serves on 127.0.0.1.

    It ends with the program that started it. An empty first line means that it could not start: its log says why.
    """
    words = [sys.executable, "-m", "ddenv.scene", str(run), "--port", str(port)]
    with run.with_name(f"{run.name}.scene.log").open("ab") as log:
        return subprocess.Popen(
            words, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log, text=True, start_new_session=True
        )
