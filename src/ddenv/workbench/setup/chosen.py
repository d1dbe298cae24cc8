"""What is picked on the setup screen: read away from the screen's thread, since worlds can be large."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddenv.errors import UserError
from ddenv.workbench.wording import count, plain

if TYPE_CHECKING:
    from ddenv.world.model import Model, World
    from ddenv.world.scenario import Reading, Scenario

# Wheels that begin in the ground would throw the robot.
ABOVE = 0.02


def support(world: World, x: float, y: float) -> float | None:
    """The highest top of what stands at (x, y), m: of the boxes around the shapes there. None where there is nothing."""
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


def clearance(robot: Model) -> float:
    """How far the robot's frame is above the ground it stands on, m."""
    from ddenv.world.extent import model_bounds

    box = model_bounds(robot)
    return ABOVE if box is None else ABOVE + float(robot.pose.position[2] - box[0][2])


def spawn_height(world: World, clear: float, x: float, y: float) -> float | None:
    """The z of a spawn at (x, y) for a robot whose frame is `clear` above the ground, m, to the mm; None over nothing."""
    top = support(world, x, y)
    return None if top is None else round(top + clear, 3)


# How high a robot's frame is taken to be where its file cannot be read, which Start complains about, m.
SOME_HEIGHT = 0.2


@dataclass(frozen=True)
class Chosen:
    """A world, how it was read, and its scenario unless a bare world was picked.

    `settings` has the options that the form starts with: the scenario's own, or the defaults. `clear` is how far the robot's frame
    is above what it stands on, m. `run` says that all of it came out of the run file `path`.
    """

    path: Path
    world: World
    reading: Reading
    scenario: Scenario | None
    settings: Scenario
    clear: float
    run: bool = False

    @property
    def name(self) -> str:
        return self.scenario.name if self.scenario else self.path.name

    @property
    def models(self) -> int:
        """How many models a reduction could remove."""
        return len(self.world.elements(frozenset(self.settings.protected)))

    @property
    def about(self) -> str:
        """What is told below the map."""
        notes = self.world.notes
        noted = f" {count(len(notes), 'part')} replaced or ignored (ddenv world check tells)." if notes else ""
        models = f"{self._removable}{noted}"
        if self.run:
            return f"{models} As in the run {plain(self.path.stem)}. {plain(self.settings.description)}"
        if self.scenario is not None:
            return f"{models} {plain(self.scenario.description)}"
        return f"{models} A world without a scenario: give the robot a spawn and a goal, on the map or in numbers."

    @property
    def _removable(self) -> str:
        if self.models == 0:
            return "No model of it can be removed: there is nothing to reduce."
        if self.models == 1:
            return "1 model: all that can be found is whether the failure needs it."
        return f"{self.models} models."


def read_choice(path: Path, options: Mapping[str, Any]) -> Chosen:
    """A scenario or a world file; `options` are those of the command line on how to read worlds. Raises UserError."""
    from ddenv.runs.scenarios import reading_of, scenario_for_world
    from ddenv.world.load import load_scenario
    from ddenv.world.read import read_world
    from ddenv.world.scenario import PLAIN

    scenario = load_scenario(path) if path.suffix.lower() in (".yaml", ".yml") else None
    reading = reading_of(scenario.reading if scenario else PLAIN, **options)
    settings = scenario or scenario_for_world(path, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0))
    settings = settings.model_copy(update={"reading": reading})
    world = read_world(settings.world, reading)
    return Chosen(path, world, reading, scenario, settings, _clear(world, settings, scenario is not None))


def read_run(path: Path) -> Chosen:
    """The scenario and the world that a run file holds, wherever their own files are. Raises UserError."""
    from ddenv.runfile.store import RunFile
    from ddenv.runs.creation import read_parts

    with RunFile(path) as run:
        scenario, world, robot = read_parts(run)
    clear = _above(world, scenario) or clearance(robot)
    return Chosen(path, world, scenario.reading, scenario, scenario, clear, run=True)


def _clear(world: World, settings: Scenario, placed: bool) -> float:
    """As high as the scenario has the robot, or else as its shapes need."""
    above = _above(world, settings) if placed else None
    if above is not None:
        return above
    try:
        return clearance(_robot(settings))
    except UserError:
        return SOME_HEIGHT


def _above(world: World, scenario: Scenario) -> float | None:
    spawn = scenario.robot.spawn
    ground = support(world, spawn.x, spawn.y)
    return None if ground is None or spawn.z < ground else spawn.z - ground


def _robot(settings: Scenario) -> Model:
    from ddenv.world.read import read_model

    return read_model(settings.robot.model, settings.reading)
