"""What the scene shows: pure functions from the run's state and running tests to a `Shot`, with
their titles.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ddenv.runfile.state import Candidate, RunState, Test, Trial
from ddenv.runfile.store import Live
from ddenv.runfile.tested import purpose

HOLD = 3.0  # how long a finished test stays on screen until the next one starts, s


@dataclass(frozen=True, slots=True, kw_only=True)
class Shot:
    """What is shown: a running test ("live"), a replay of a finished one ("replay"), or the robot
    at its start ("start").

    Elements: `models` are in the test, `left_out` in the environment but not in the test, `removed`
    are removed.
    """

    kind: str
    test: int | None
    models: frozenset[str]
    left_out: frozenset[str]
    removed: frozenset[str]
    title: str


def shot(
    state: RunState, live: Sequence[Live], previous: Shot | None = None, idle: float = math.inf
) -> Shot:
    """What to show, `idle` s after a test was last running. Stays with the `previous` test while it
    runs.
    """
    running = [
        test for test in state.tests_of(row.test for row in live) if test.outcome == "running"
    ]
    before = previous if previous is not None and previous.kind == "live" else None
    if running:
        same = (test for test in running if before is not None and test.id == before.test)
        return shot_of_test(state, "live", next(same, running[0]))
    if state.status in ("baseline", "running") and before is not None and idle < HOLD:
        return before
    shown = [state.evidence_test] if state.evidence_test is not None else []
    if state.waiting_candidate is not None and state.round is not None:
        tests = state.tests_of(state.round.candidates[state.waiting_candidate].tests)
        shown += [test.id for test in tests if test.shows_f]
    finished = (test for test in reversed(state.tests) if test.is_finished)
    test = next(reversed(state.tests_of(shown)), None) or next(finished, None)
    if test is None:
        return _shot(state, "start", None, frozenset(state.environment), "the robot at its start")
    return shot_of_test(state, "replay", test)


def shot_of(state: RunState, row: Candidate | Trial, live: Sequence[Live]) -> Shot:
    """What to show of a candidate or a try: the test that runs, or the last one that showed f, or
    the last one that ended.
    """
    tests = state.tests_of(row.tests)
    # At an earlier moment of the run, what ran then has ended by now.
    running = [test for test in tests if test.outcome == "running"]
    similar = [test for test in tests if test.shows_f]
    if not tests:
        return _shot(state, "start", None, frozenset(row.models), f"{row.label} · not tested yet")
    test = (running[:1] or similar[-1:] or tests[-1:])[0]
    kind = "live" if any(each.test == test.id for each in live) and running else "replay"
    return shot_of_test(state, kind, test, row)


def shot_of_test(
    state: RunState, kind: str, test: Test, row: Candidate | Trial | None = None
) -> Shot:
    """What to show of a test, which belongs to `state`, and was made for `row` if that is given."""
    name = purpose(state, test) if row is None else row.label
    models = frozenset(state.models_of(test))
    if test.id == state.evidence_test and kind == "replay" and row is None:
        name = "the failure f" if test.id in state.failures[:1] else "the failure in what is left"
        models = frozenset(state.environment)
    words = [name, f"test {test.id}"] if test.id > 0 else [name]
    if test.phase == "round" and test.run > 0:
        words.append(f"re-run {test.run}")
    words.append("runs now" if kind == "live" else test.outcome)
    return _shot(state, kind, test.id, models, " · ".join(words))


def _shot(state: RunState, kind: str, test: int | None, models: frozenset[str], title: str) -> Shot:
    kept = frozenset(state.environment)
    return Shot(
        kind=kind,
        test=test,
        models=models,
        left_out=kept - models,
        removed=frozenset(state.elements) - kept - models,
        title=title,
    )
