"""What a user names, and what stands behind it: scenario, world and robot of a run, of a scenario
file or of an SDF world.
"""

from __future__ import annotations

import json
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from ddenv.errors import UserError
from ddenv.runfile.fold import fold, recorded_scenario
from ddenv.runfile.state import RunState
from ddenv.runfile.store import RunFile
from ddenv.runs.folder import named, named_file
from ddenv.runs.preferences import state_file
from ddenv.runs.remedies import REMEDIES, remembered, with_remedies
from ddenv.schemas import nearest
from ddenv.settings import SETTINGS, Ignorable, MeshReading, Value, number_text, put, read
from ddenv.text import Data, Names, first_of, shortened
from ddenv.world.access import MissingFiles, is_read_as_world, read_bytes, resolved, write_file
from ddenv.world.command import command_words
from ddenv.world.files.resources import Resources
from ddenv.world.load import SDF, find_scenario, load_scenario, validate
from ddenv.world.model import Model, World
from ddenv.world.placement import at_start, check_spawn
from ddenv.world.pose import Point
from ddenv.world.scenario import PLAIN, Reading, Scenario
from ddenv.world.sdf.read import disk_of, parse_model, parse_world, read_model, read_world
from ddenv.world.sdf.standin import AUTO, NONE, parse_option

Announce = Callable[[str], None]
# Reads the content of a file.
Parse = Callable[[bytes, Path, Reading, Resources], object]
# Downloads what a file lacks, which is read in this way.
Fetch = Callable[[Path, Reading, Parse], None]
# Prefix of the names of documents in a run file that hold other files.
RESOURCE = "resource "
# The options on how a world is read.
READING = ("model_path", "stand_in", "ignore", "inside", "mesh")
# Maximum number of remembered remedies that a line names, and the maximum width of each in cells.
NAMED = 3
LONGEST = 60


@dataclass(frozen=True, kw_only=True)
class Experiment:
    """What the robot is run in. Of a run, `run` is its file, and `state` its last one."""

    scenario: Scenario
    world: World
    robot: Model
    run: Path | None = None
    state: RunState | None = None

    @property
    def elements(self) -> Names:
        return self.world.elements(self.scenario.protected)


def open_experiment(
    name: str, given: Mapping[str, Any], announce: Announce | None = None
) -> Experiment:
    """What `name` stands for: a run if there is one of that name, else a scenario or a world with
    the options `given`.

    `announce` gets a line on what is remembered. Raises UserError.
    """
    kind, path = named(name) or ("scenario", Path(name))
    if kind != "run":
        scenario = scenario_named(name, given, announce)
        world, robot = load_parts(scenario)
        return Experiment(scenario=scenario, world=world, robot=robot)
    if has_options(given):
        raise UserError(
            "--spawn, --goal, --world, --timeout, --model-path, --stand-in, --ignore, --inside "
            "and --fetch are only for scenarios; "
            "a run keeps its own"
        )
    with RunFile(path) as file:
        return read_subject(file)


def has_options(given: Mapping[str, Any], *but: str) -> bool:
    """Whether any of these options was given, `but` some."""
    return any(
        value is not None and value != ()
        for name, value in given.items()
        if name not in ("remembered", *but)
    )


# From files and options.


def scenario_named(
    name: str, given: Mapping[str, Any], announce: Announce | None = None
) -> Scenario:
    """The scenario of a name or a file, with the options `given`: places, those on how its world is
    read, and settings.

    Raises UserError.
    """
    others = dict(given)
    reads_remembered = others.pop("remembered", False)
    fetch: Fetch | None = others.pop("fetch", None)
    reading = {option: others.pop(option) for option in READING if option in others}
    spawn = given["spawn"]
    goal = given["goal"]
    if not is_read_as_world(Path(name)):
        scenario = load_scenario(find_scenario(name))
    elif spawn is None or goal is None:
        # A file that is no world needs no places either.
        read_world(Path(name), reading_of(**reading))
        example = "--spawn 0,0,0.2,0 --goal 9,0 (x,y,z,yaw and x,y, m and rad)"
        raise UserError(f"{name}: a world needs a start and a goal, such as {example}")
    elif given["world"] is not None:
        raise UserError(f"--world: only for a scenario; {name} is a world")
    else:
        scenario = scenario_for_world(Path(name), (*spawn, 0.0)[:4], goal)
    read_as = reading_of(scenario.reading, **reading)
    scenario = with_options(scenario, reading=read_as, **others)
    if fetch is not None:
        fetch(scenario.world, read_as, parse_world)
        fetch(scenario.robot.model, read_as, parse_model)
    if reads_remembered:
        read_as = with_remembered(scenario.world, read_as, announce)
        scenario = scenario.model_copy(update={"reading": read_as})
    return without_guesses_at_start(scenario, announce)


def world_of(path: Path) -> tuple[Path, Reading]:
    """The world that a file is, or that a scenario's file or name stands for; and how the scenario
    reads it. Raises UserError.
    """
    kind, path = named_file(str(path)) or ("world", path)
    if kind == "world":
        return path, PLAIN
    scenario = load_scenario(path)
    return scenario.world, scenario.reading


def reading_of(
    reading: Reading = PLAIN,
    *,
    model_path: Sequence[Path] = (),
    stand_in: Sequence[str] = (),
    ignore: Sequence[Ignorable] = (),
    inside: bool | None = None,
    mesh: MeshReading | None = None,
) -> Reading:
    """`reading` with more folders (searched first), stand-ins (`URI=SHAPE`), ignored elements,
    `inside` and `mesh`.

    Raises UserError.
    """
    for folder in model_path:
        if not folder.is_dir():
            raise UserError(f"--model-path: there is no folder {folder}")
    folders = (*(folder.resolve() for folder in model_path), *reading.model_path)
    stand_ins = reading.stand_ins | dict(parse_option(option) for option in stand_in)
    ignored = dict.fromkeys((*reading.ignore, *ignore))
    within = reading.inside or bool(inside)
    return Reading(
        model_path=folders,
        stand_ins=stand_ins,
        ignore=tuple(ignored),
        inside=within,
        mesh=mesh or reading.mesh,
    )


def with_remembered(world: Path, reading: Reading, announce: Announce | None = None) -> Reading:
    """How to read a world, with the remedies that the user chose for files which it lacks; it says
    which these are.

    Whatever else is wrong with the world shows when it is read.
    """
    known = remembered()
    found = dict[str, str]()
    read_as = reading
    while known:
        read_as = reading_of(reading, **with_remedies({}, found))
        try:
            read_world(world, read_as)
            break
        except MissingFiles as error:
            fresh = {uri: known[uri] for uri in error.uris if uri in known and uri not in found}
            if not fresh:
                break
            found |= fresh
        except UserError:
            break
    if found and announce is not None:
        names = first_of(
            [f"{shortened(uri, LONGEST)} ({text})" for uri, text in found.items()], NAMED
        )
        announce(
            f"uses what you chose for {names}; {state_file(REMEDIES)} keeps that, "
            "--no-remembered leaves it out"
        )
    if found:
        return read_as
    return reading


def without_guesses_at_start(scenario: Scenario, announce: Announce | None = None) -> Scenario:
    """`scenario`, in which what is missing is left out where a guess of its shape would be around
    the robot; it says what that is.

    Raises UserError.
    """
    reading = scenario.reading
    left_out = list[str]()
    if AUTO not in reading.stand_ins.values():
        return scenario
    robot = read_model(scenario.robot.model, reading)
    while True:
        world = read_world(scenario.world, reading)
        around = at_start(world, robot, scenario.robot.spawn)
        uris = [
            uri
            for name, uri in world.guessed
            if around is not None and name in (around.name, around.inside)
        ]
        if not uris:
            break
        left_out += uris
        stand_ins = {**reading.stand_ins, **dict.fromkeys(uris, NONE)}
        reading = reading.model_copy(update={"stand_ins": stand_ins})
    if left_out and announce is not None:
        names = first_of([shortened(uri, LONGEST) for uri in left_out], NAMED)
        announce(f"the robot would start inside a guess, so this is left out: {names}")
    return scenario.model_copy(update={"reading": reading})


def scenario_for_world(
    world: Path, spawn: tuple[float, float, float, float], goal: Point
) -> Scenario:
    """A scenario for the bundled robot in any SDF world: `spawn` x, y, z m and yaw rad, `goal` x, y
    m. Raises UserError.
    """
    data = {
        "name": world.stem.removesuffix(".dmd")[:80] or "world",
        "world": str(resolved(world)),
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
    protect: Sequence[str] = (),
    **values: Value,
) -> Scenario:
    """`scenario` with some of its settings replaced; those that are None stay. Raises UserError.

    `protect` are more models that always stay. `spawn` is x, y, z m and yaw rad (0 if left out),
    `goal` x, y m. `values` are settings by name; 0 takes back a limit.
    """
    given = {name: value for name, value in values.items() if value is not None}
    for name, value in given.items():
        one = SETTINGS.get(name)
        # 0 takes back a limit; words are checked with the scenario.
        if (
            one
            and not isinstance(value, bool | str)
            and (value or not one.none)
            and not one.allows(value)
        ):
            raise UserError(
                f"{one.option or one.key}: expected {one.range}, found {number_text(value)}"
            )
    chosen = with_values(scenario.model_dump(mode="json"), given)
    if spawn is not None:
        chosen["robot"]["spawn"] = dict(zip(("x", "y", "z", "yaw"), spawn, strict=False))
    if goal is not None:
        chosen["goal"].update(zip(("x", "y"), goal, strict=True))
    if world is not None:
        chosen["world"] = str(world.resolve())
    chosen["protected"] += protect
    if reading is not None:
        chosen["reading"] = reading.model_dump(mode="json")
    named = {SETTINGS[name].key: SETTINGS[name].option for name in given if SETTINGS[name].option}
    places = (("--spawn", "robot.spawn", spawn), ("--goal", "goal", goal))
    named |= {
        f"{key}.{axis}": option
        for option, key, place in places
        if place
        for axis in ("x", "y", "z", "yaw")
    }
    return validate(chosen, "options", named)


def with_values(data: Data, values: Mapping[str, Value]) -> Data:
    """A scenario as plain data, with settings replaced by name; None or 0 takes back a limit.
    Raises UserError.
    """
    for name in values:
        if name not in SETTINGS:
            raise UserError(f"options: no setting '{name}'{nearest(name, SETTINGS)}")
    # A setting that sets several others comes first, so that each of these may be given, too.
    for name in sorted(values, key=lambda each: SETTINGS[each].stored):
        put(data, SETTINGS[name], (values[name] or None) if SETTINGS[name].none else values[name])
    return data


def load_parts(scenario: Scenario) -> tuple[World, Model]:
    """The world and the robot of a scenario, checked against each other; the world's `resources`
    are those of both.

    Raises UserError.
    """
    if scenario.oracle is not None:
        command_words(scenario)
    reading = scenario.reading
    robot_file = scenario.robot.model
    world = read_world(scenario.world, reading)
    around_robot = disk_of(robot_file, reading)
    robot = parse_model(read_bytes(robot_file), robot_file, reading, around_robot)
    world = replace(world, resources={**world.resources, **around_robot.taken})
    check_parts(scenario, world, robot)
    return world, robot


def check_parts(scenario: Scenario, world: World, robot: Model) -> None:
    """Whether a scenario fits its world and its robot. Raises UserError."""
    known = {name for model in world.models for name in (model.name, model.inside)}
    for name in scenario.protected:
        if name not in known:
            raise UserError(f"protected: the world {scenario.world} has no model '{name}'")
    if not world.elements(scenario.protected):
        raise UserError(f"{scenario.world}: has no model that can be removed")
    if scenario.reading.inside and not any(model.inside for model in world.models):
        why = next(
            (note.why for note in world.notes if note.what == "--inside"),
            "no static model has two collisions",
        )
        raise UserError(
            f"{scenario.world}: --inside: no model has parts that can be removed: {why}"
        )
    check_spawn(world, robot, scenario.robot.spawn, scenario.goal)


# From a run file.


def read_subject(file: RunFile) -> Experiment:
    """The scenario, world and robot of a run, and its state. Raises UserError."""
    scenario, world, robot = read_parts(file)
    state = fold(file.events())
    failure = scenario.failure.model_copy(
        update={"epsilon": read(state.scenario, SETTINGS["epsilon"])}
    )
    return Experiment(
        scenario=scenario.model_copy(update={"failure": failure}),
        world=world,
        robot=robot,
        run=file.path,
        state=state,
    )


def read_parts(run: RunFile) -> tuple[Scenario, World, Model]:
    """The scenario, world and robot of a run file. Raises UserError."""
    scenario = read_scenario(run)
    # Never opens another file, whatever the run file says.
    stored = Resources(run.documents(RESOURCE))
    world = parse_world(run.document("world"), scenario.world, scenario.reading, stored)
    robot = parse_model(run.document("robot"), scenario.robot.model, scenario.reading, stored)
    if fold(run.events(most=1)).elements != world.elements(scenario.protected):
        raise UserError(f"{run.path}: damaged run file: its elements are not those of its world")
    return scenario, world, robot


def read_scenario(run: RunFile) -> Scenario:
    """The scenario of a run file. Raises UserError."""
    try:
        return Scenario.model_validate(recorded_scenario(json.loads(run.document("scenario"))))
    except (AttributeError, ValueError):
        raise UserError(f"{run.path}: damaged run file: its scenario is not valid") from None


@contextmanager
def robot_file(subject: Experiment) -> Iterator[Path]:
    """The robot's file; one with the run's own text, as long as this lasts, where the original is
    not on this machine.
    """
    original = subject.scenario.robot.model
    if subject.run is None or original.is_file():
        yield original
        return
    with tempfile.TemporaryDirectory(prefix="ddenv-robot-") as folder:
        file = Path(folder) / original.name
        with RunFile(subject.run) as run:
            write_file(file, run.document("robot"))
        yield file
