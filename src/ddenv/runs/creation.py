"""Creates run files from scenarios, and reads scenario, world and robot back from them."""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from ddenv.errors import UserError
from ddenv.runfile.events import as_it_was
from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile, create
from ddenv.runs.clusters import check_cluster
from ddenv.runs.scenarios import check_parts, load_parts
from ddenv.world.access import read_bytes, write_file
from ddenv.world.files.resources import Stored
from ddenv.world.model import Model, World
from ddenv.world.scenario import Scenario
from ddenv.world.sdf.read import parse_model, parse_world

# Prefix of the names of documents that hold other files.
RESOURCE = "resource "


def create_run(scenario: Scenario, path: Path, announce: Callable[[str], None] | None = None) -> World:
    """Writes a new run file with everything a reduction needs; returns its world. Raises UserError, with nothing written.

    Calls `announce` with a line of text before slow steps.
    """
    check_cluster(scenario.reduction.cluster)
    world, _ = load_parts(scenario, announce)
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
    """Writes a new run file at `path` with the world and the robot of `run`, and another `scenario`.

    The original files of world and robot are not needed. Raises UserError, with nothing written.
    """
    check_cluster(scenario.reduction.cluster)
    with RunFile(run) as file:
        _, world, robot = read_parts(file)
        documents = {f"{RESOURCE}{key}": content for key, content in file.documents(RESOURCE).items()}
        documents |= {name: file.document(name) for name in ("world", "robot")}
    check_parts(scenario, world, robot)
    documents["scenario"] = scenario.model_dump_json().encode()
    elements = world.elements(frozenset(scenario.protected))
    create(path, documents, {"scenario": scenario.model_dump(mode="json"), "elements": elements})


def read_parts(run: RunFile) -> tuple[Scenario, World, Model]:
    """The scenario, world and robot of a run file. Raises UserError."""
    scenario = read_scenario(run)
    # Never opens another file, whatever the run file says.
    stored = Stored(run.documents(RESOURCE))
    world = parse_world(run.document("world"), scenario.world, scenario.reading, stored)
    robot = parse_model(run.document("robot"), scenario.robot.model, scenario.reading, stored)
    if fold(run.events(most=1)).elements != world.elements(frozenset(scenario.protected)):
        raise UserError(f"{run.path}: damaged run file: its elements are not those of its world")
    return scenario, world, robot


@contextmanager
def robot_file(run: RunFile, scenario: Scenario) -> Iterator[Path]:
    """The robot's file; one with the run's own text, as long as this lasts, where the original is not on this machine."""
    if scenario.robot.model.is_file():
        yield scenario.robot.model
        return
    with tempfile.TemporaryDirectory(prefix="ddenv-robot-") as folder:
        file = Path(folder) / scenario.robot.model.name
        write_file(file, run.document("robot"))
        yield file


def read_scenario(run: RunFile) -> Scenario:
    """The scenario of a run file. Raises UserError."""
    try:
        return Scenario.model_validate(as_it_was(json.loads(run.document("scenario"))))
    except ValueError:
        raise UserError(f"{run.path}: damaged run file: its scenario is not valid") from None
