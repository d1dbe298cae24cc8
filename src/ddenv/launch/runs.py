"""Run files by name: where they are, how one is made from a scenario, and what it was made from."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

import platformdirs

from ddenv.errors import UserError
from ddenv.launch.scenarios import check_parts, load_parts
from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile, create
from ddenv.world.files.resources import Stored
from ddenv.world.files.whole import read_bytes
from ddenv.world.model import Model, World
from ddenv.world.read import parse_model, parse_world
from ddenv.world.scenario import Scenario

SUFFIX = ".ddenv"
# Bytes of a run's name, which leaves room for a number and for the names of the files beside it.
LONGEST_STEM = 180
# How the names of documents begin that were read of other files.
RESOURCE = "resource "


def runs_folder() -> Path:
    """Where runs are kept unless a path is given: `$DDENV_HOME/runs`, or the user's data folder."""
    home = os.environ.get("DDENV_HOME")
    return (Path(home) if home else Path(platformdirs.user_data_dir("ddenv", appauthor=False))) / "runs"


def find_run(name: str) -> Path:
    """The run file called `name`, a path or a name in the runs folder."""
    path = Path(name)
    if path.is_file() or len(path.parts) > 1:
        return path
    return runs_folder() / f"{name.removesuffix(SUFFIX)}{SUFFIX}"


def free_run_path(scenario_name: str) -> Path:
    """The first free name-1, name-2, ... in the runs folder."""
    return _free(runs_folder(), scenario_name)


def _free(folder: Path, scenario_name: str) -> Path:
    stem = "".join(char if char.isalnum() or char in "-_" else "-" for char in scenario_name)
    # A name of 80 letters can have four bytes for each, which no file system takes.
    stem = stem.encode()[:LONGEST_STEM].decode(errors="ignore")
    number = 1
    while (path := folder / f"{stem}-{number}{SUFFIX}").exists():
        number += 1
    return path


def run_path(scenario_name: str, name: str | None, output: Path | None) -> Path:
    """Where a new run is written: `output` (a .ddenv file or a folder), or in the runs folder. Raises UserError."""
    if name is not None and (not name.strip() or any(char in name for char in "/\\\0") or name.startswith(".")):
        raise UserError(f"--name: '{name}' cannot be a file's name; use letters, digits, - and _")
    name = None if name is None else name.removesuffix(SUFFIX)
    if output is None or output.suffix in (".sdf", ".world"):
        if output is not None and not output.parent.is_dir():
            raise UserError(f"--output: there is no folder {output.parent}")
        return free_run_path(scenario_name) if name is None else runs_folder() / f"{name}{SUFFIX}"
    if output.is_dir():
        return _free(output, scenario_name) if name is None else output / f"{name}{SUFFIX}"
    if output.suffix != SUFFIX:
        raise UserError(f"--output: '{output}' is neither a folder nor a {SUFFIX}, .sdf or .world file")
    return output


def create_run(scenario: Scenario, path: Path, tell: Callable[[str], None] | None = None) -> World:
    """Writes a new run file that holds all a reduction needs; returns its world. Raises UserError, with nothing written.

    `tell` is called with a line before something that takes longer.
    """
    world, _ = load_parts(scenario, tell)
    documents = {f"{RESOURCE}{key}": content for key, content in world.resources.items()}
    documents |= {
        "scenario": scenario.model_dump_json().encode(),
        "world": world.text,
        "robot": read_bytes(scenario.robot.model),
    }
    elements = world.elements(frozenset(scenario.protected))
    create(path, documents, {"scenario": scenario.model_dump(mode="json"), "elements": elements})
    return world


def create_like(run: Path, scenario: Scenario, path: Path) -> None:
    """Writes a new run file at `path` for the world and the robot that `run` holds, with another `scenario` for them.

    Nothing else is read: neither the world's own file nor the robot's need be there any more. Raises UserError, with nothing
    written.
    """
    with RunFile(run) as file:
        _, world, robot = read_parts(file)
        documents = {f"{RESOURCE}{key}": content for key, content in file.documents(RESOURCE).items()}
        documents |= {name: file.document(name) for name in ("world", "robot")}
    check_parts(scenario, world, robot)
    documents["scenario"] = scenario.model_dump_json().encode()
    elements = world.elements(frozenset(scenario.protected))
    create(path, documents, {"scenario": scenario.model_dump(mode="json"), "elements": elements})


def read_parts(run: RunFile) -> tuple[Scenario, World, Model]:
    """What a run file was made from: its scenario, its world and its robot."""
    try:
        scenario = Scenario.model_validate_json(run.document("scenario"))
    except ValueError:
        raise UserError(f"{run.path}: damaged run file: its scenario is not valid") from None
    # Whatever a run file says, nothing else on this machine is opened for it.
    stored = Stored(run.documents(RESOURCE))
    world = parse_world(run.document("world"), scenario.world, scenario.reading, stored)
    robot = parse_model(run.document("robot"), scenario.robot.model, scenario.reading, stored)
    if fold(run.events(most=1)).elements != world.elements(frozenset(scenario.protected)):
        raise UserError(f"{run.path}: damaged run file: its elements are not those of its world")
    return scenario, world, robot
