"""Exports the minimal environment of a run: as SDF, and with a scenario that runs the robot in
it.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from ddenv.errors import UserError
from ddenv.evidence.margins import fixes_of
from ddenv.runfile.state import RunState
from ddenv.runfile.store import RunFile
from ddenv.runs.experiment import RESOURCE, Experiment, read_subject
from ddenv.runs.reasons import removed_in_passing
from ddenv.runs.trust import scenario_text
from ddenv.schemas import nearest
from ddenv.text import Data, Names
from ddenv.world.access import Missing, Unusable, check_ending, write_file
from ddenv.world.files.resources import Resources, find
from ddenv.world.model import World
from ddenv.world.scenario import Scenario
from ddenv.world.sdf.numbers import NotPossible, Number, changed, numbers_of
from ddenv.world.sdf.read import parse_model, parse_world
from ddenv.world.whole import whole_of
from ddenv.world.write import without


@dataclass(frozen=True, slots=True)
class Exported:
    """The written files, and the URIs of other files that the written world needs. `whole`: f was
    not known yet.
    """

    files: list[Path]
    needs: list[str]
    whole: bool = False


def export_world(
    run: Path,
    sdf: Path,
    scenario_file: Path | None,
    passes: bool = False,
    margins: Sequence[str] = (),
) -> Exported:
    """Writes the current environment of a run, or the nearest world that `passes`, to `sdf`, and a
    scenario for it if asked.

    With `margins`, NAME or NAME=VALUE, these numbers are changed: to the value nearest to the
    present one at which the robot reaches its goal if no other is given. Raises UserError.
    """
    with RunFile(run) as file:
        subject = read_subject(file)
        robot = file.document("robot")
        documents = file.documents(RESOURCE)
    scenario = subject.scenario
    world = subject.world
    state = subject.state
    assert state is not None
    check_ending(sdf, scenario.world)
    if not state.elements:
        raise UserError(f"{run}: nothing has been run yet; start it with 'ddenv resume {run}'")
    removed = frozenset(
        removed_in_passing(state, run) if passes else set(state.elements) - set(state.environment)
    )
    there = with_margins(subject, margins)
    if scenario_file is None and there.scenario != scenario:
        raise UserError(
            "--margin: this is a number of the scenario, not of the world: also give --scenario "
            "FILE"
        )
    scenario = there.scenario
    world = there.world
    try:
        text = without(world, removed)
    except ValueError as error:
        raise UserError(f"{run}: damaged run file: its world has {error}") from None
    write_file(sdf, text)
    asked = Resources(documents)
    # What is left of a model is a whole model there.
    minimal = parse_world(
        text, scenario.world, scenario.reading.model_copy(update={"inside": False}), asked
    )
    needs = list(dict.fromkeys(uri for uri, base in asked.asked if base == scenario.world.parent))
    if scenario_file is None:
        return Exported([sdf], needs, whole=state.baseline is None)
    is_urdf = scenario.robot.model.suffix.lower() == ".urdf"
    model = scenario_file.with_suffix(".robot.urdf" if is_urdf else ".robot.sdf")
    write_file(model, robot)
    folder = scenario_file.parent.resolve()
    data = keys_in(folder, scenario)
    data["world"] = _name(sdf, folder)
    data["robot"]["model"] = _name(model, folder)
    data["whole"] = whole_of(world, scenario).model_dump(mode="json")
    data["protected"] = renamed(scenario.protected, world, removed, minimal)
    # Those folders of the original world and robot that the exported files still need, and the
    # robot's packages.
    own = scenario.robot.model
    asked_by_robot = Resources(documents)
    parse_model(robot, own, scenario.reading, asked_by_robot)
    both = ((scenario.world.parent, asked), (own.parent, asked_by_robot))
    needed = [
        each for each, by in both if any(_leans_on(each, uri, base) for uri, base in by.asked)
    ]
    around = (each for each in own.absolute().parents if each.name and each.is_dir())
    needed += [each for each in around if f"package://{each.name}/".encode() in robot]
    data["reading"]["inside"] = False
    model_path = (*scenario.reading.model_path, *needed)
    data["reading"]["model_path"] = list(dict.fromkeys(_name(each, folder) for each in model_path))
    write_file(scenario_file, scenario_text(data, scenario))
    return Exported([sdf, model, scenario_file], needs, whole=state.baseline is None)


def with_margins(subject: Experiment, margins: Sequence[str]) -> Experiment:
    """A run's world and scenario with the changes that `margins`, each NAME or NAME=VALUE, mean.
    Raises UserError.
    """
    scenario = subject.scenario
    world = subject.world
    state = subject.state
    for margin in margins:
        if subject.run is None or state is None:
            raise UserError("--margin: needs a run; a scenario has no margins yet")
        name, value = _margin(
            state,
            numbers_of(scenario, world, subject.robot, state.environment),
            margin,
            subject.run,
        )
        try:
            scenario, world = changed(scenario, world, {name: value})
        except NotPossible as error:
            raise UserError(f"--margin: {name} cannot be {value:g}: {error}") from None
    return replace(subject, scenario=scenario, world=world)


def _margin(
    state: RunState, numbers: Mapping[str, Number], margin: str, run: Path
) -> tuple[str, float]:
    """The number that is meant, and its new value. Raises UserError."""
    name, _, given = margin.partition("=")
    if name not in numbers:
        raise UserError(f"--margin: what is left has no number '{name}'{nearest(name, numbers)}")
    if given:
        try:
            value = float(given)
        except ValueError:
            value = math.nan
        if not math.isfinite(value):
            raise UserError(f"--margin: expected NAME=NUMBER, found '{margin}'")
        return name, value
    fixes = () if state.margins is None else fixes_of(state.margins)
    found = next(
        (fix.value for fix in fixes if fix.name == name and fix.confirmed is not False), None
    )
    if found is None:
        again = (
            f"look for one with: ddenv margins {run} --number '{name}', or give a value: "
            f"--margin {name}=VALUE"
        )
        raise UserError(
            f"--margin: no value of {name} is known at which the robot reaches its goal; {again}"
        )
    return name, found


def keys_in(folder: Path, scenario: Scenario) -> Data:
    """The keys of a file in `folder` with this scenario: what lies in there is named relative to
    it, so that it can be moved.
    """
    data = scenario.model_dump(mode="json")
    # The scenario's folder is only searched for the user's own programs.
    if scenario.oracle is None and ":" not in scenario.controller.use:
        del data["folder"]
    else:
        data["folder"] = _name(scenario.folder, folder)
    if scenario.oracle is not None and scenario.oracle.folder is not None:
        data["oracle"]["folder"] = _name(scenario.oracle.folder, folder)
    data["world"] = _name(scenario.world, folder)
    data["robot"]["model"] = _name(scenario.robot.model, folder)
    data["reading"]["model_path"] = [_name(each, folder) for each in scenario.reading.model_path]
    return data


def _name(path: Path, folder: Path) -> str:
    """`path` as written in a scenario in `folder`: relative if it lies in that folder, so that the
    folder can be moved.
    """
    path = path.resolve()
    return str(path.relative_to(folder) if path.is_relative_to(folder) else path)


def renamed(protected: Names, world: World, removed: frozenset[str], minimal: World) -> Names:
    """The names of protected models in the minimal world, where copies of one name are numbered
    anew; a part's is its model's.
    """
    wholes = {model.name: model.inside or model.name for model in world.models}
    kept = dict.fromkeys(whole for name, whole in wholes.items() if name not in removed)
    now = dict.fromkeys(model.inside or model.name for model in minimal.models)
    names = dict(zip(kept, now, strict=True))
    return tuple(dict.fromkeys(names[wholes.get(name, name)] for name in protected))


def _leans_on(folder: Path, uri: str, base: Path) -> bool:
    """Whether `uri`, in a file of the folder `base`, can be found relative to `folder`."""
    if "://" not in uri:
        return base == folder and not uri.strip().startswith("/")
    folder = folder.resolve()
    try:
        return find(uri, folder, (folder,)).is_relative_to(folder)
    except (Missing, Unusable):
        return False
