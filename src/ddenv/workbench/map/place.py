"""What a map needs of a scenario: read away from the screen's thread, since worlds can be large."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from ddenv.workbench.map.world_map import Place
from ddenv.workbench.run.observed import Busy, Observed

if TYPE_CHECKING:
    from ddenv.world.model import World
    from ddenv.world.scenario import Scenario

# How long a run that another program writes is asked again, s.
PATIENCE = 10.0


def place_of(world: World, scenario: Scenario | None = None) -> Place:
    """The models of a world, with the scenario's start and goal if there is one."""
    from ddenv.map.footprints import footprints

    protected = frozenset(scenario.protected) if scenario else frozenset()
    place = Place(footprints(world), elements=frozenset(world.elements(protected)))
    if scenario is None:
        return place
    spawn, goal = scenario.robot.spawn, scenario.goal
    return replace(place, spawn=(spawn.x, spawn.y, spawn.yaw), goal=(goal.x, goal.y))


def place_of_run(path: Path) -> Place:
    """What a run file was made from. Raises UserError."""
    # Reading scenarios needs pydantic, which is not needed for the first look at a run.
    from ddenv.runs.creation import read_parts

    until = time.monotonic() + PATIENCE
    while True:
        try:
            with Observed(path) as run:
                scenario, world, _ = read_parts(run)
            return place_of(world, scenario)
        except Busy:
            # The world is asked for once: what another program writes now is done soon.
            if time.monotonic() > until:
                raise
            time.sleep(0.1)
