"""Finds what rests on what before the first test of a run, and writes it as an event: views know it without Drake."""

from __future__ import annotations

from ddenv.engine.bench import Bench
from ddenv.engine.journal import Journal
from ddenv.engine.pool import Broken
from ddenv.errors import UserError
from ddenv.world.model import World
from ddenv.world.scenario import Scenario


def settle(scenario: Scenario, world: World, journal: Journal, bench: Bench) -> None:
    """Does nothing where nothing can move, or if it is known. Raises UserError if stacks are to be kept and it cannot be known."""
    moves = any(model.links and not model.static for model in world.models)
    if journal.has("supports") or not moves:
        return
    needed = scenario.reduction.keep_supports
    if scenario.oracle is not None:
        if needed:
            raise UserError(
                "reduction.keep_supports: only ddenv's own simulator finds what rests on what; leave it out, or 'oracle'"
            )
        return
    elements = journal.state.elements
    found = bench.find_supports(frozenset(elements), lambda: journal.record("supports_started"))
    if not isinstance(found, Broken):
        number = {name: index for index, name in enumerate(elements)}
        journal.record("supports", pairs=[[number[upper], number[lower]] for upper, lower in found])
    elif needed:
        raise UserError(f"reduction.keep_supports: what rests on what is unknown: {found.failure}")
    else:
        journal.record("supports", pairs=[], why=found.failure)
