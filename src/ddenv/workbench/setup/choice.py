"""The choice on the setup screen: a scenario, a world or a run, read in a thread since worlds can be large."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddenv.errors import UserError
from ddenv.text import count, plain
from ddenv.workbench.setup.missing_files import Missing, read_with_remedies
from ddenv.world.access import is_world

if TYPE_CHECKING:
    from ddenv.world.model import Model, World
    from ddenv.world.scenario import Reading, Scenario

# A robot starts this far above the ground, m: wheels that start inside it would throw the robot.
GAP = 0.02
# The height of a robot's frame if its file cannot be read, m; Start then reports the file's error.
SOME_HEIGHT = 0.2


@dataclass(frozen=True)
class Choice:
    """A world, how it was read, and its scenario unless a bare world was chosen.

    `settings` has the options that the form starts with: the scenario's own, or the defaults. `clearance` is how far the robot's
    frame is above the ground, m. With `run`, all comes from the run file `path`. `options` are those of the command line that
    read the world so, `missing` are files that it names but that cannot be found.
    """

    path: Path
    world: World
    reading: Reading
    scenario: Scenario | None
    settings: Scenario
    clearance: float
    run: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)
    missing: tuple[Missing, ...] = ()

    @cached_property
    def robot(self) -> Model:
        """Raises UserError if its file cannot be read."""
        from ddenv.runs.subject import read_parts
        from ddenv.world.sdf.read import read_model

        if not self.run:
            return read_model(self.settings.robot.model, self.reading)
        from ddenv.runfile.store import RunFile

        with RunFile(self.path) as run:
            return read_parts(run)[2]

    def check_remedies(self) -> None:
        """Raises UserError while a missing file has no remedy: its guess is shown, but only run with if the user takes it."""
        undecided = sum(not each.remedy for each in self.missing)
        if undecided:
            raise UserError(f"{count(undecided, 'missing file')} without a remedy: press m")

    @property
    def name(self) -> str:
        return self.scenario.name if self.scenario else self.path.name

    @property
    def models(self) -> int:
        return len(self.world.elements(frozenset(self.settings.protected)))

    @property
    def about(self) -> str:
        from ddenv.world.load import SCENARIOS

        words = f"{self.models} models."
        if self.models < 2:
            words = (
                "None of its models can be removed: there is nothing to reduce.",
                "1 model: a run can only show whether the failure needs it.",
            )[self.models]
        if self.run:
            return f"{words} As in the run {plain(self.path.stem)}. {plain(self.settings.description)}"
        # The list has the name of a bundled file.
        where = "" if self.path.parent == SCENARIOS else f" {plain(str(self.path))}"
        if self.scenario is not None:
            return f"{words} {plain(self.scenario.description)}{where}"
        return f"{words} A world without a scenario: set the robot's spawn and goal, on the map or as numbers.{where}"


def read_choice(path: Path, options: Mapping[str, Any]) -> Choice:
    """A scenario, a world or a run file; `options` are the command line's on how to read worlds. Raises UserError."""
    if path.suffix == ".ddenv":
        return _read_run(path)
    from ddenv.runs.subject import reading_of, scenario_for_world
    from ddenv.world.load import load_scenario
    from ddenv.world.scenario import PLAIN

    scenario = None if is_world(path) else load_scenario(path)
    own = scenario.reading if scenario else PLAIN
    settings = scenario or scenario_for_world(path, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0))
    world, chosen, missing = read_with_remedies(settings.world, own, options)
    reading = reading_of(own, **chosen)
    settings = settings.model_copy(update={"reading": reading})
    clearance = _clearance(world, settings, scenario is not None)
    return Choice(path, world, reading, scenario, settings, clearance, options=chosen, missing=missing)


def _read_run(path: Path) -> Choice:
    """The scenario and the world that a run file holds, wherever their own files are."""
    from ddenv.runfile.store import RunFile
    from ddenv.runs.subject import read_parts

    with RunFile(path) as run:
        scenario, world, robot = read_parts(run)
    clearance = _scenario_clearance(world, scenario) or _robot_clearance(robot)
    return Choice(path, world, scenario.reading, scenario, scenario, clearance, run=True)


def spawn_height(world: World, clearance: float, x: float, y: float) -> float | None:
    """The z of a spawn at (x, y) for a robot with that `clearance`, m, to the mm; None where there is no ground."""
    top = _ground(world, x, y)
    return None if top is None else round(top + clearance, 3)


def _ground(world: World, x: float, y: float) -> float | None:
    """The highest top of the boxes around the shapes at (x, y), m. None where there is nothing."""
    from ddenv.world.extent import shape_bounds
    from ddenv.world.model import Plane

    tops = []
    for model in world.models:
        for collision in model.collisions:
            if isinstance(collision.shape, Plane):
                tops.append(float(collision.pose.position[2]))
                continue
            low, high = shape_bounds(collision.shape, collision.pose)
            if low[0] <= x <= high[0] and low[1] <= y <= high[1]:
                tops.append(float(high[2]))
    return max(tops, default=None)


def _clearance(world: World, settings: Scenario, placed: bool) -> float:
    """The scenario's clearance, or else the clearance that the robot's shapes need."""
    from ddenv.world.sdf.read import read_model

    above = _scenario_clearance(world, settings) if placed else None
    if above is not None:
        return above
    try:
        return _robot_clearance(read_model(settings.robot.model, settings.reading))
    except UserError:
        return SOME_HEIGHT


def _scenario_clearance(world: World, scenario: Scenario) -> float | None:
    spawn = scenario.robot.spawn
    ground = _ground(world, spawn.x, spawn.y)
    return None if ground is None or spawn.z < ground else spawn.z - ground


def _robot_clearance(robot: Model) -> float:
    from ddenv.world.extent import model_bounds

    box = model_bounds(robot)
    return GAP if box is None else GAP + float(robot.pose.position[2] - box[0][2])
