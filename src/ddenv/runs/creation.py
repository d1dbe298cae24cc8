"""Creates run files: of what a user named, of a scenario, or like another run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from ddenv.errors import UserError
from ddenv.runfile.events import Created
from ddenv.runfile.fold import fold
from ddenv.runfile.store import RunFile, create
from ddenv.runs.experiment import (
    RESOURCE,
    Announce,
    check_parts,
    has_options,
    load_parts,
    read_parts,
    scenario_named,
)
from ddenv.runs.export import renamed
from ddenv.runs.folder import named, run_path
from ddenv.runs.trust import check_cluster, check_named, trust_cluster, trusted_scenario
from ddenv.world.access import check_ending, is_world, read_bytes
from ddenv.world.files.resources import Resources
from ddenv.world.model import World
from ddenv.world.scenario import Scenario
from ddenv.world.sdf.read import parse_world
from ddenv.world.whole import whole_of
from ddenv.world.write import without


def create_named(
    subject: str,
    given: Mapping[str, Any],
    asks: Callable[[str], bool],
    name: str | None,
    output: Path | None,
    announce: Announce | None = None,
) -> tuple[Path, World]:
    """Writes a new run of the scenario or the world `subject`, with the options `given`; returns
    its file and its world.

    `asks` whether what it starts is trusted. `name` and `output` as for `run_path`. Raises
    UserError, with nothing written.
    """
    if output is not None and is_world(output) and output.exists():
        raise UserError(f"--output: {output} exists already; choose another name")
    if given.get("inside") and (of_run := named(subject)) is not None and of_run[0] == "run":
        if has_options(given, "inside"):
            only = "give only --name, --output, --jobs, --trust and --json"
            raise UserError(f"--inside: a run keeps its own options; {only}")
        with RunFile(of_run[1]) as file:
            scenario = trusted_scenario(file, asks, None)
        path = run_path(f"{scenario.name}-inside", name, output)
        return path, create_inside(of_run[1], path)
    scenario = scenario_named(subject, given, announce)
    if output is not None and is_world(output):
        check_ending(output, scenario.world)
    if given["cluster"]:
        trust_cluster(scenario)
    check_named(scenario, subject, asks)
    path = run_path(scenario.name, name, output)
    return path, create_run(scenario, path)


def create_run(scenario: Scenario, path: Path) -> World:
    """Writes a new run file with everything a reduction needs; returns its world. Raises UserError,
    with nothing written.
    """
    check_cluster(scenario.reduction.cluster)
    world, _ = load_parts(scenario)
    documents = {"world": world.text, "robot": read_bytes(scenario.robot.model)}
    _write(scenario, world, path, documents, world.resources)
    return world


def create_like(run: Path, scenario: Scenario, path: Path) -> None:
    """Writes a new run file at `path` with the world and the robot of `run`, and another
    `scenario`.

    The original files of world and robot are not needed. Raises UserError, with nothing written.
    """
    check_cluster(scenario.reduction.cluster)
    with RunFile(run) as file:
        _, world, robot = read_parts(file)
        documents = {name: file.document(name) for name in ("world", "robot")}
        resources = file.documents(RESOURCE)
    check_parts(scenario, world, robot)
    _write(scenario, world, path, documents, resources)


def create_inside(run: Path, path: Path) -> World:
    """Writes a new run file at `path` with what is left of `run`, whose models are opened into
    their parts; returns its world.

    Raises UserError, with nothing written.
    """
    with RunFile(run) as file:
        scenario, whole, robot = read_parts(file)
        state = fold(file.events())
        documents = file.documents("")
        stored = Resources(file.documents(RESOURCE))
    if scenario.reading.inside:
        raise UserError(f"{run}: is a reduction inside models already")
    removed = frozenset(state.elements) - frozenset(state.environment)
    documents["world"] = without(whole, removed)
    reading = scenario.reading.model_copy(update={"inside": True})
    world = parse_world(documents["world"], scenario.world, reading, stored)
    documents["world"] = world.text
    protected = renamed(scenario.protected, whole, removed, world)
    update = {"reading": reading, "whole": whole_of(whole, scenario), "protected": protected}
    scenario = scenario.model_copy(update=update)
    check_parts(scenario, world, robot)
    _write(scenario, world, path, documents, world.resources)
    return world


def _write(
    scenario: Scenario,
    world: World,
    path: Path,
    documents: dict[str, bytes],
    resources: Mapping[str, bytes],
) -> None:
    documents["scenario"] = scenario.model_dump_json().encode()
    documents |= {f"{RESOURCE}{key}": content for key, content in resources.items()}
    elements = world.elements(scenario.protected)
    number = {name: at for at, name in enumerate(elements)}
    # What is welded to a model that stays is tied to nothing.
    welds = tuple(
        (number[one], number[other])
        for one, other in world.ties
        if one in number and other in number
    )
    create(
        path,
        documents,
        Created(scenario=scenario.model_dump(mode="json"), elements=elements, welds=welds),
    )
