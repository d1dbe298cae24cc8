"""What the result is worth: what fresh runs show of what is left, and of that without each model."""

from __future__ import annotations

from ddenv.claims import current, drift, meaning, missing, never_left_out, promise, verdict_on
from ddenv.page.blocks import Block, Cell, Name, Section, Table, percent, say, thousands
from ddenv.report.run_data import Record
from ddenv.runfile.progress import Certificate
from ddenv.runfile.state import RunState
from ddenv.runs.fresh_runs import FreshRuns, fresh_runs
from ddenv.text import plain

# The maximum number of models with a row each.
MOST_ROWS = 200


def worth(record: Record) -> Section | None:
    """The section on the certificate, or on why there is none; None before f is known."""
    state = record.state
    if state.baseline is None or not state.nodes:
        return None
    found = current(state)
    blocks = _without(state) if found is None else _with(state, found)
    return Section("What it is worth", tuple(blocks))


def _without(state: RunState) -> list[Block]:
    so_far = drift(state)
    words = missing(state)
    first = f"{words[:1].upper()}{words[1:]}: nothing is claimed of what is left."
    return [say(first, f" From all runs so far: {so_far[0]}." if so_far else "")]


def _with(state: RunState, found: Certificate) -> list[Block]:
    rows = fresh_runs(state)
    head = ("environment", "runs", "ended", "f shown", "95 % interval", "which means")
    table = Table(head, tuple(_row(each, found) for each in rows[:MOST_ROWS]), frozenset({1, 3, 4}), frozenset({0}))
    words = (
        "These runs have seeds that the search did not use, and none of them ended early. Rates leave broken runs out."
    )
    if state.certified:
        means = promise(state, found)
        words += f" {means[:1].upper()}{means[1:]}."
    return [table, say(words), *_earlier(state, found)]


def _row(each: FreshRuns, found: Certificate) -> tuple[Cell, ...]:
    ended = ", ".join(f"{number} {outcome}" for outcome, number in each.outcomes)
    shown = percent(each.shown / each.runs) if each.runs else "–"
    interval = f"{percent(each.low)} to {percent(each.high)}" if each.runs else "–"
    means = "" if each.claim is None else meaning(each.claim, found)
    return _name(each), thousands(each.runs), ended, shown, interval, means


def _name(each: FreshRuns) -> Cell:
    if each.without is not None:
        return "without ", Name(each.without)
    if each.is_left:
        return "what is left"
    return "the whole world" if each.node == 0 else f"environment {each.node}"


def _earlier(state: RunState, found: Certificate) -> list[Block]:
    """Other certificates of the same environment: each stands for itself."""
    others = [one for one in state.certificates if one.node == found.node and one.claims and one is not found]
    return [
        say(f"Certificate {one.number}, made before: {plain(verdict_on(one, never_left_out(state, one)))}.")
        for one in others
    ]


def rate_of_left(state: RunState) -> tuple[str, str]:
    """How often f shows in what is left, and what that is, for the figures at the top."""
    found, here = current(state), state.here
    if found is not None:
        return f"{found.claims[0].shown} of {thousands(found.claims[0].runs)}", "fresh runs show f"
    if here is None or not here.runs:
        return "", ""
    return f"{here.shown} of {thousands(len(here.runs))}", "runs of it show f"
