"""Finds what rests on what before the first test of a run, and writes it as an event: views know it without Drake."""

from __future__ import annotations

from ddenv.engine.bench import Bench
from ddenv.engine.journal import Journal
from ddenv.engine.noting import note
from ddenv.engine.pool import Broken
from ddenv.errors import UserError
from ddenv.robot.settled import notes_on
from ddenv.runfile.events import Still, Supports, SupportsStarted
from ddenv.world.model import Model, World
from ddenv.world.placement import notes_on_start
from ddenv.world.scenario import Scenario


def note_start(scenario: Scenario, world: World, robot: Model, journal: Journal) -> None:
    """Notes what the files alone show of the start, before the first test."""
    if journal.state.baseline is None:
        for about, words in notes_on_start(world, robot, scenario.robot.spawn):
            note(journal, about, words)


def settle(scenario: Scenario, world: World, journal: Journal, bench: Bench) -> None:
    """Does nothing where nothing can move, or if it is known. Notes what is wrong with the start of the world.

    Raises UserError if stacks are to be kept and it cannot be known.
    """
    moves = any(model.links and not model.static for model in world.models)
    if not moves and scenario.reduction.slice and journal.state.ties is None:
        journal.record(Still())
    if journal.state.ties is not None or journal.state.unsettled or journal.state.supports or not moves:
        return
    needed = scenario.reduction.keep_supports
    if scenario.oracle is not None:
        if needed:
            raise UserError(
                "reduction.keep_supports: only ddenv's own simulator finds what rests on what; leave it out, or 'oracle'"
            )
        return
    elements = journal.state.elements
    found = bench.settle(frozenset(elements), lambda: journal.record(SupportsStarted()))
    if not isinstance(found, Broken):
        for about, words in notes_on(world, found.settled):
            note(journal, about, words)
        ties = None if found.ties is None else journal.pairs(found.ties)
        journal.record(Supports(journal.pairs(found.supports), ties))
    elif needed:
        raise UserError(f"reduction.keep_supports: what rests on what is unknown: {found.failure}")
    else:
        journal.record(Supports((), why=found.failure))
