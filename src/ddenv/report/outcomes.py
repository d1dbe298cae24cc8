"""How sure the result of a run is: its baseline, how its tests ended, the other failures they met,
and its fresh runs.
"""

from __future__ import annotations

import math
from collections import Counter

from ddenv.evidence.claims import FreshRuns, current, fresh_runs
from ddenv.page.blocks import (
    Block,
    Cell,
    Name,
    Section,
    Strong,
    Table,
    named,
    percent,
    say,
    thousands,
)
from ddenv.report.run_data import Record
from ddenv.runfile.failure_words import DEEDS
from ddenv.runfile.failures import atlas
from ddenv.runfile.progress import Certificate
from ddenv.runfile.state import BROKEN, RunState
from ddenv.text import as_sentence, count, plain
from ddenv.words.baseline import failed_in, missed
from ddenv.words.claims import drift, means, missing, promise, shows
from ddenv.words.early_stop import WHY, why_off
from ddenv.words.slices import TEACHING, refuted_words, slice_words

# The maximum number of models with a row each.
MOST_ROWS = 200
MEANING = {
    "similar": "f again: the robot did not reach the goal, and ended where it ended in f",
    "other": "another failure",
    "pass": "the goal was reached",
    "error": "the simulation broke",
    "timeout": "the test took too long in real time",
    "failed": "failed before f was known",
}
PHASES = (
    ("baseline", "whole world"),
    ("round", "in rounds"),
    ("hand", "by hand"),
    ("audit", "audits of slices"),
    ("certify", "fresh runs"),
    ("isolate", "isolation"),
)
# The maximum number of failures in the table, and of models by name.
MOST = 30
MOST_NAMES = 6


def sureness(record: Record) -> Section | None:
    """The section on baseline and tests; None before a test has ended."""
    state = record.state
    if not state.tests_done:
        return None
    mixed = (
        say(
            Strong("Mixed tests."),
            f" They were made with {plain(one)}, which do not give the same bits.",
            notice=True,
        )
        for one in state.physics.mixed
    )
    return Section("How certain it is", (*_baseline(state), *_tests(state), *mixed))


def _baseline(state: RunState) -> list[Block]:
    base = state.baseline
    if base is None:
        return [
            say("The baseline has not ended: how often the whole world fails is not known yet.")
        ]
    words = (
        f"In the whole world the robot {failed_in(state, base)} in {base.failures} of "
        f"{count(base.runs, 'run')}: "
        f"{percent(base.rate)}, 95 % interval {percent(base.low)} to {percent(base.high)}."
    )
    if base.broken:
        words += (
            f" {count(base.broken, 'more run')} broke, and {'is' if base.broken == 1 else 'are'} "
            "not counted."
        )
    blocks: list[Block] = [say(words)]
    if base.rate < 1:
        blocks.append(say(as_sentence(missed(state))))
    if base.others:
        rows = tuple(
            (str(number), one.name, str(one.runs)) for number, one in enumerate(base.seen, 1)
        )
        f = {row for row, one in enumerate(base.seen) if one.test == base.failure_test}
        words = (
            "The whole world shows several failures. The run began with the one in bold as f; "
            "--failure NUMBER reduces another one."
        )
        words += (
            f" The first {count(base.chose, 'run')} only chose it, and are not in its rate."
            if base.chose
            else ""
        )
        blocks += [say(words), Table(("number", "failure", "runs"), rows, {0, 2}, f)]
    return blocks


def _tests(state: RunState) -> list[Block]:
    finished = state.finished_tests
    counts = Counter((test.outcome, test.phase) for test in finished)
    phases = [
        (phase, words) for phase, words in PHASES if any(test.phase == phase for test in finished)
    ]
    rows = []
    for outcome, number in state.outcomes().items():
        if number:
            by_phase = (str(counts[outcome, phase] or "–") for phase, _ in phases)
            rows.append(
                (
                    outcome,
                    str(number),
                    percent(number / state.tests_done),
                    *by_phase,
                    _meaning(state, outcome),
                )
            )
    head = ("outcome", "tests", "share", *(words for _, words in phases), "meaning")
    table = Table(head, rows, range(1, 3 + len(phases)))
    # Before the end of the run, anything may still come to be needed.
    ahead = state.ahead if state.status == "finished" else 0
    words = (
        f"Of these tests {thousands(state.deflake_runs)} were re-runs of candidates whose first "
        "test did not show f, and "
        f"{thousands(state.cut_tests)} ended early: {WHY}"
    )
    if ahead:
        idle = f"; {thousands(ahead)} were started early by idle workers and not needed"
    else:
        idle = ""
    off = [say(as_sentence(said))] if (said := why_off(state)) else []
    return [table, say(f"{words}{idle}."), *off, *_slices(state)]


def _slices(state: RunState) -> list[Block]:
    """What was known, and what went, without a test."""
    blocks: list[Block] = []
    if state.implied:
        if state.audits:
            audits = f"; {thousands(state.audits)} more were simulated anyway, for comparison"
        else:
            audits = ""
        known = (
            f"{thousands(state.implied)} of the tests were not simulated: finished runs imply "
            f"them{audits}."
        )
        blocks.append(say(f"{known} {TEACHING}"))
    for node in state.nodes:
        if node.how == "sliced":
            blocks.append(say(f"Environment {node.number}: {slice_words(state, node)}."))
    if words := refuted_words(state):
        blocks.append(say(Strong("Slices were wrong."), f" {plain(words)}.", notice=True))
    return blocks


def _meaning(state: RunState, outcome: str) -> str:
    meaning = MEANING[outcome]
    if outcome == "other":
        ways = Counter(
            test.failure
            for test in state.tests
            if test.outcome == "other" and test.failure in DEEDS
        )
        meaning += (
            f" ({', '.join(f'{word} {times}' for word, times in ways.most_common())})"
            if ways
            else ""
        )
    if outcome in BROKEN:
        last = next((test for test in reversed(state.tests) if test.outcome == outcome), None)
        meaning += (
            f", the last time: {plain(last.failure)[:200]}"
            if last is not None and last.failure
            else ""
        )
    return meaning


def others_met(record: Record) -> Section | None:
    """The section on other failures; None if there is none."""
    state = record.state
    found = atlas(record.state)
    if not found:
        return None
    tests = count(sum(len(each.tests) for each in found), "test")
    lead = say(
        f"{count(len(found), 'other failure')} in {tests}, each with the smallest environment "
        "that showed it. "
        "The workbench reduces any of them in a branch of the run (key f)."
    )
    head = ("failure", "from f's end, m", "tests", "smallest environment", "its models")
    rows = []
    for each in found[:MOST]:
        size = f"{count(each.size, 'model')} (test {each.smallest})"
        if state.f_position is None:
            away = ""
        else:
            away = f"{math.dist(state.f_position, each.position):.2f}"
        models = named(state.models_of(state.test(each.smallest)), MOST_NAMES) or "none"
        rows.append((each.name, away, thousands(len(each.tests)), size, models))
    more = len(found) - MOST
    rest = [say(f"And {count(more, 'more failure')}.")] if more > 0 else []
    return Section("Other failures met", (lead, Table(head, rows, {1, 2}), *rest))


def worth(record: Record) -> Section | None:
    """The section on the certificate, or on why there is none; None before f is known."""
    state = record.state
    if state.baseline is None or not state.nodes:
        return None
    found = current(state)
    rows = [each for each in fresh_runs(state)[:MOST_ROWS] if shows(each.claim)]
    if found is not None:
        return Section("What the result is worth", tuple(_with(state, found)))
    if rows:
        claimed = "what its runs have shown so far still holds"
    else:
        claimed = "nothing is claimed about what is left"
    so_far = drift(state)
    first = as_sentence(f"{missing(state)}: {claimed}")
    blocks: list[Block] = [say(first, f" From all runs so far: {so_far[0]}." if so_far else "")]
    if rows:
        shown = [
            (
                _name(each),
                thousands(each.claim.runs),
                thousands(each.claim.shown),
                shows(each.claim),
            )
            for each in rows
        ]
        blocks.append(Table(("environment", "runs", "with f", "shown"), shown, {1, 2}))
    return Section("What the result is worth", tuple(blocks))


def _with(state: RunState, found: Certificate) -> list[Block]:
    head = ("environment", "runs", "ended", "f shown", "95 % interval", "meaning")
    rows = []
    for each in fresh_runs(state)[:MOST_ROWS]:
        claim = each.claim
        ended = ", ".join(f"{number} {outcome}" for outcome, number in claim.outcomes)
        shown = "–"
        interval = "–"
        if each.has_rate:
            shown = percent(claim.shown / claim.runs)
        if each.has_rate and not (claim.verdict and claim.is_exact):
            interval = f"{percent(claim.low)} to {percent(claim.high)}"
        meaning = means(state, found, claim) if claim.verdict else shows(claim)
        rows.append((_name(each), thousands(claim.runs), ended, shown, interval, meaning))
    words = (
        "These runs have seeds that the search did not use, and none of them ended early. Rates "
        "exclude broken runs."
    )
    if found.seeds:
        words = (
            "What is left ran with seeds that the search did not use; without each model it ran "
            "with the chosen seeds."
        )
    if state.certified:
        words += f" {as_sentence(promise(state, found))}"
    return [Table(head, rows, {1, 3, 4}, {0}), say(words)]


def _name(each: FreshRuns) -> Cell:
    if each.without is not None:
        return "without ", Name(each.without)
    if each.is_left:
        return "what is left"
    world = "the whole world" if each.node == 0 else f"environment {each.node}"
    if each.is_chosen:
        return f"{world}, with seeds that did not show f in what is left"
    return world


def rate_of_left(state: RunState) -> tuple[str, str]:
    """How often f shows in what is left, and what that is, for the figures at the top."""
    found = current(state)
    here = state.here
    if found is not None:
        return f"{found.claims[0].shown} of {thousands(found.claims[0].runs)}", "fresh runs show f"
    if here is None or not here.runs:
        return "", ""
    return f"{here.shown} of {thousands(len(here.runs))}", "runs of it show f"
