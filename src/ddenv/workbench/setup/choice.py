"""The choice on the setup screen: a scenario, a world or a run, read in a thread since worlds can
be large.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddenv.errors import UserError
from ddenv.runs.remedies import remembered
from ddenv.text import plain
from ddenv.workbench.setup.missing_files import UNSUPPORTED, Missing, read_with_remedies
from ddenv.world.access import Unsupported, is_read_as_world

if TYPE_CHECKING:
    from ddenv.world.model import Model, World
    from ddenv.world.scenario import Scenario

# A robot starts this far above the ground, m: wheels that start inside it would throw the robot.
GAP = 0.02


@dataclass(frozen=True, kw_only=True)
class Choice:
    """A world, and the `settings` that the form starts with: the scenario's own, or the defaults
    for a `bare` world.

    With `run`, all comes from the run file `path`. `options` are those of the command line that
    read the world so, `missing` are files that it names but that cannot be found.
    """

    path: Path
    world: World
    settings: Scenario
    bare: bool = False
    run: bool = False
    options: Mapping[str, Any] = field(default_factory=dict)
    missing: tuple[Missing, ...] = ()

    @cached_property
    def robot(self) -> Model:
        """Raises UserError if its file cannot be read."""
        from ddenv.runfile.store import RunFile
        from ddenv.runs.experiment import read_parts
        from ddenv.world.sdf.read import read_model

        if not self.run:
            return read_model(self.settings.robot.model, self.settings.reading)
        with RunFile(self.path) as run:
            return read_parts(run)[2]

    @cached_property
    def height_above(self) -> float:
        """How far the robot's frame is above the ground, m: as in the scenario, or else as the
        robot's shapes need.
        """
        from ddenv.world.extent import model_bounds

        spawn = self.settings.robot.spawn
        ground = None if self.bare else self._ground(spawn.x, spawn.y)
        if ground is not None and spawn.z >= ground:
            return spawn.z - ground
        try:
            box = model_bounds(self.robot)
        except UserError:
            # Start then reports the file's error.
            return GAP
        if box is None:
            return GAP
        return GAP + float(self.robot.pose.position[2] - box[0][2])

    def spawn_height(self, x: float, y: float) -> float | None:
        """The z of a spawn at (x, y), m, to the mm; None where there is no ground."""
        top = self._ground(x, y)
        if top is None:
            return None
        return round(top + self.height_above, 3)

    def _ground(self, x: float, y: float) -> float | None:
        """The highest top of the boxes around the shapes at (x, y), m. None where there is
        nothing.
        """
        import numpy as np

        from ddenv.world.extent import shape_bounds
        from ddenv.world.model import Plane, Terrain
        from ddenv.world.terrain import height_above

        tops = []
        for collision in self.world.collisions:
            if isinstance(collision.shape, Terrain):
                top = -height_above(collision.shape, collision.pose, np.array([[x, y, 0.0]]))
                tops += [top] if math.isfinite(top) else []
                continue
            if isinstance(collision.shape, Plane):
                tops.append(float(collision.pose.position[2]))
                continue
            low, high = shape_bounds(collision.shape, collision.pose)
            if low[0] <= x <= high[0] and low[1] <= y <= high[1]:
                tops.append(float(high[2]))
        return max(tops, default=None)

    @property
    def name(self) -> str:
        if self.bare:
            return self.path.name
        return self.settings.name

    @property
    def models(self) -> int:
        return len(self.world.elements(self.settings.protected))

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
            return (
                f"{words} As in the run {plain(self.path.stem)}. {plain(self.settings.description)}"
            )
        # The list has the name of a bundled file.
        where = "" if self.path.parent == SCENARIOS else f" {plain(str(self.path))}"
        if self.bare:
            return (
                f"{words} A world without a scenario: set the robot's spawn and goal, on the map "
                f"or as numbers.{where}"
            )
        return f"{words} {plain(self.settings.description)}{where}"


def read_choice(path: Path, options: Mapping[str, Any]) -> Choice:
    """A scenario, a world or a run file; `options` are the command line's on how to read worlds.
    Raises UserError.
    """
    from ddenv.runs.experiment import read_parts, reading_of, scenario_for_world
    from ddenv.world.load import load_scenario

    if path.suffix == ".ddenv":
        from ddenv.runfile.store import RunFile

        # The scenario's own files may be elsewhere by now.
        with RunFile(path) as run:
            scenario, world, _ = read_parts(run)
        return Choice(path=path, world=world, settings=scenario, run=True)
    bare = is_read_as_world(path)
    if bare:
        settings = scenario_for_world(path, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0))
    else:
        settings = load_scenario(path)
    try:
        world, chosen, missing = read_with_remedies(settings.world, settings.reading, options)
    except Unsupported as error:
        # Without the user's word it is left out on the map alone.
        choice = read_choice(path, {**options, "ignore": (*options.get("ignore", ()), error.tag)})
        element = Missing(
            error.name, remembered().get(error.name, ""), "not supported, left out", UNSUPPORTED
        )
        return replace(choice, missing=(*choice.missing, element))
    settings = settings.model_copy(update={"reading": reading_of(settings.reading, **chosen)})
    return Choice(
        path=path, world=world, settings=settings, bare=bare, options=chosen, missing=missing
    )
