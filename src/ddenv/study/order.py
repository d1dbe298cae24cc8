"""In which order cells are made: those that take long first, so that no worker waits for the last one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ddenv.launch.scenarios import load_parts
from ddenv.study.plan import Cell, Plan
from ddenv.world.scenario import Scenario

# What a model that can move costs in a test, beside one that cannot: about as much as was measured of piles of boards.
MOVES = 4
# Equal spans of time put most of a world into one part, which takes many rounds to come apart.
SLOW = ("timeseg/", "trajectoryseg/")


@dataclass(frozen=True, slots=True)
class Size:
    """A scenario's world: how many models can be removed, and what a test of it costs, in models that do not move."""

    models: int
    cost: int


def sizes(plan: Plan) -> dict[str, Size]:
    """The sizes of the scenarios' worlds by the scenarios' names. Raises UserError for a world or a robot that cannot be read."""
    return {scenario.name: _size(scenario) for scenario in plan.scenarios}


def _size(scenario: Scenario) -> Size:
    world, _ = load_parts(scenario)
    elements = set(world.elements(frozenset(scenario.protected)))
    moving = sum(not model.static for model in world.models if model.name in elements)
    return Size(len(elements), len(elements) + MOVES * moving)


def longest_first(cells: Sequence[Cell], worlds: dict[str, Size]) -> list[Cell]:
    """The cells as they are to be made."""
    return sorted(cells, key=lambda cell: (-worlds[cell.scenario.name].cost, not cell.method.pair.startswith(SLOW)))
