"""What is picked on the setup screen: read away from the screen's thread, since worlds can be large."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddenv.workbench.wording import count, plain

if TYPE_CHECKING:
    from ddenv.world.model import World
    from ddenv.world.scenario import Reading, Scenario


@dataclass(frozen=True)
class Chosen:
    """A world, how it was read, and its scenario unless a bare world was picked.

    `settings` has the options that the form starts with: the scenario's own, or the defaults.
    """

    path: Path
    world: World
    reading: Reading
    scenario: Scenario | None
    settings: Scenario

    @property
    def name(self) -> str:
        return self.scenario.name if self.scenario else self.path.name

    @property
    def about(self) -> str:
        """What is told below the map."""
        protected = frozenset(self.scenario.protected) if self.scenario else frozenset()
        models = count(len(self.world.elements(protected)), "model")
        notes = self.world.notes
        noted = f" {count(len(notes), 'part')} replaced or ignored (ddenv world check tells)." if notes else ""
        if self.scenario is not None:
            return f"{models}.{noted} {plain(self.scenario.description)}"
        return f"{models}.{noted} A world without a scenario: give the robot a spawn and a goal below."


def read_choice(path: Path, options: Mapping[str, Any]) -> Chosen:
    """A scenario or a world file; `options` are those of the command line on how to read worlds. Raises UserError."""
    from ddenv.launch.scenarios import reading_of, scenario_for_world
    from ddenv.world.load import load_scenario
    from ddenv.world.read import read_world
    from ddenv.world.scenario import PLAIN

    scenario = load_scenario(path) if path.suffix.lower() in (".yaml", ".yml") else None
    reading = reading_of(scenario.reading if scenario else PLAIN, **options)
    settings = scenario or scenario_for_world(path, (0.0, 0.0, 0.0, 0.0), (0.0, 0.0))
    return Chosen(path, read_world(scenario.world if scenario else path, reading), reading, scenario, settings)
