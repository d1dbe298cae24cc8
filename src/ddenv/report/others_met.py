"""The failures other than f that the tests of a run met."""

from __future__ import annotations

import math

from ddenv.amounts import count
from ddenv.page.blocks import Cell, Name, Part, Section, Table, say, thousands
from ddenv.report.run_data import Record
from ddenv.runfile.atlas import OtherFailure, atlas
from ddenv.runfile.state import RunState

# The maximum number of failures in the table, and of models by name.
MOST, MOST_NAMES = 30, 6


def others_met(record: Record) -> Section | None:
    """The section on other failures; None if there is none."""
    found = atlas(record.state)
    if not found:
        return None
    tests = count(sum(len(each.tests) for each in found), "test")
    lead = say(
        f"{count(len(found), 'other failure')} in {tests}, each with the smallest environment that showed it. "
        "The workbench reduces any of them in a branch of the run (key f)."
    )
    head = ("failure", "from f's end, m", "tests", "smallest environment", "its models")
    table = Table(head, tuple(_row(record.state, each) for each in found[:MOST]), frozenset({1, 2}))
    more = len(found) - MOST
    rest = [say(f"And {count(more, 'more failure')}.")] if more > 0 else []
    return Section("Other failures met", (lead, table, *rest))


def _row(state: RunState, failure: OtherFailure) -> tuple[Cell, ...]:
    models = state.models_of(state.tests[failure.smallest - 1])
    names: list[Part] = []
    for name in models[:MOST_NAMES]:
        names += [", ", Name(name)]
    more = len(models) - MOST_NAMES
    names += [f" and {more} more"] if more > 0 else []
    size = f"{count(failure.size, 'model')} (test {failure.smallest})"
    f = state.f_position
    away = "" if f is None else f"{math.dist(f, failure.position):.2f}"
    return failure.name, away, thousands(len(failure.tests)), size, tuple(names[1:]) or "none"
