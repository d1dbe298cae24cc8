"""Folds tests: what each ran and how it ended, how often f showed in each environment, and the
baseline.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import fields, replace
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from ddenv.environment import Numbers
from ddenv.runfile.progress import Node, Point, Removal
from ddenv.runfile.state import (
    CERTIFY,
    ISOLATE,
    Candidate,
    PersistentTuple,
    Round,
    RunState,
    Test,
    Trial,
)
from ddenv.text import Data

if TYPE_CHECKING:
    from ddenv.runfile import events as e

# The fields of the state that an event changes, with their new values.
Changes = dict[str, Any]
# How a test ended: an implied one as the test that implies it.
END = ("outcome", "failure", "distance", "end_pose", "simulated_seconds", "cut", "took_part")


def test_started(state: RunState, event: e.TestStarted | e.Implied, _: float) -> Changes:
    removals = state.removals
    removal = None
    node = state.node
    if event.phase == ISOLATE:
        (removals, removal) = with_removal(state, event.environment)
        node = 0
    elif event.phase == CERTIFY and event.without is None:
        # Of a fresh run, that with its environment on the way to the current one.
        node = next(
            (one.number for one in reversed(state.path) if one.id == event.environment), node
        )
    special = {
        "id": event.test,
        "without": None if event.without is None else state.elements[event.without],
        "removal": removal,
        "node": node,
        "engine": state.engines,
    }
    test = Test(**shared(event, Test) | special)
    if test.id != len(state.tests) + 1 or test.environment >= len(state.environments):
        raise ValueError(test.id)
    changes = {
        "tests": state.tests.added(test),
        "removals": removals,
        "audits": state.audits + (test.audits is not None),
        **counts(state, None, test),
    }
    if test.phase == CERTIFY and (
        not state.certificates or test.run >= state.certificates[-1].first_run
    ):
        changes["fresh"] = state.fresh.added(test.id)
    if event.trial is not None:
        trial = state.trials[event.trial - 1]
        return changes | with_trial(state, replace(trial, tests=(*trial.tests, test.id)))
    if event.round is None or event.candidate is None:
        return changes
    candidate = candidate_of(state, event.round, event.candidate)
    return changes | with_candidate(state, replace(candidate, tests=(*candidate.tests, test.id)))


def shared(event: Any, kind: type[Any]) -> Data:
    """The fields that a part of an event and the state have in common."""
    return {
        field.name: getattr(event, field.name)
        for field in fields(kind)
        if hasattr(event, field.name)
    }


def with_removal(state: RunState, environment: int) -> tuple[PersistentTuple[Removal], int]:
    """The removals, with the one that left an environment, and its number, from 1."""
    numbered = zip(range(len(state.removals), 0, -1), reversed(state.removals), strict=True)
    for number, removal in numbered:
        if removal.environment == environment:
            return state.removals, number
    gone = (state.environments[0] - state.environments[environment]).names(state.elements)
    return state.removals.added(Removal(gone, environment)), len(state.removals) + 1


def test_finished(state: RunState, event: e.TestFinished, _: float) -> Changes:
    if event.took_part is not None and not event.took_part <= state.environments[0]:
        raise ValueError("took_part")
    values = {name: getattr(event, name) for name in END} | {
        "wall_seconds": event.wall_seconds,
        "first_sensed": tuple((state.elements[model], at) for model, at in event.first_sensed),
        "first_touched": tuple((state.elements[model], at) for model, at in event.first_touched),
        "taken": bool(event.taken),
    }
    return _ended_as(state, event.test, values)


def _ended_as(state: RunState, test: int, values: Data) -> Changes:
    changes = with_test(state, test, values)
    return changes | _noted(state, changes["tests"][test - 1])


def implied(state: RunState, event: e.Implied, at: float) -> Changes:
    """A test that starts and ends at once: it has the result of another one."""
    started = test_started(state, event, at)
    now = state.changed(**started)
    test = now.tests[-1]
    made = now.test(event.by)
    if not made.is_sound or made.implied_by is not None or made.run != test.run:
        raise ValueError(event.by)
    there = frozenset(now.models_of(test))
    values = {name: getattr(made, name) for name in END} | {
        # The robot may have had others in view.
        "first_sensed": tuple(sensed for sensed in made.first_sensed if sensed[0] in there),
        "first_touched": made.first_touched,
        "implied_by": event.by,
    }
    return {**started, **_ended_as(now, test.id, values), "implied": state.implied + 1}


def test_lost(state: RunState, event: e.TestLost, _: float) -> Changes:
    lost = state.test(event.test)
    return with_test(state, event.test, {"outcome": "lost"}) | {
        "audits": state.audits - (lost.audits is not None)
    }


def baseline_finished(state: RunState, event: e.BaselineFinished, _: float) -> Changes:
    changes = with_outcomes(state, event.judged)
    first = event.failure_test
    judged = state.changed(**changes)
    rated = (
        test.id for test in judged.tests if test.phase == "baseline" and test.run >= event.chose
    )
    runs, shown = seen(judged.tests, rated)
    whole = replace(state.nodes[0], evidence_test=first, runs=runs, shown=shown)
    history = (*state.history, Point(judged.tests_done, len(state.environment)))
    status = state.status if state.paused else "running"
    changes |= {
        "baseline": event,
        "evidence_test": first,
        "failures": (first,),
        "history": history,
        "status": status,
    }
    return changes | {"nodes": with_node(state.nodes, whole)}


def with_outcomes(state: RunState, judged: e.Outcomes) -> Changes:
    """The outcomes of tests, updated after f was fixed or another failure began to count as f."""
    for test, outcome in judged.outcomes.items():
        values = {"outcome": outcome, "distance": judged.distances.get(test)}
        state = state.changed(**with_test(state, test, values))
    return {"tests": state.tests, "tally": state.tally}


def with_test(state: RunState, id: int, values: Data) -> Changes:
    if id < 1:
        raise IndexError(id)
    before = state.test(id)
    after = replace(before, **values)
    return {"tests": state.tests.changed(id - 1, after), **counts(state, before, after)}


def counts(state: RunState, before: Test | None, after: Test) -> Changes:
    tally = dict(state.tally)
    tally[after.outcome] += 1
    if before is not None:
        tally[before.outcome] -= 1
    return {"tally": tally}


def rested_upon(before: RunState, event: e.Event) -> Changes:
    """After a verdict decisions rest on its tests, whatever the number of workers."""
    from ddenv.runfile import events as e

    if not isinstance(
        event, e.CandidateJudged | e.TrialJudged | e.CertificateFinished | e.RateLost
    ):
        return {}
    new = [test for test in dict.fromkeys(event.tests) if not before.rests_on >> test & 1]
    if any(not 0 < test <= len(before.tests) for test in new):
        raise ValueError(event.tests)
    judged = before.judged
    for test in new if isinstance(event, e.CandidateJudged | e.TrialJudged) else ():
        judged = judged.added(test)
    return {"rests_on": before.rests_on | sum(1 << test for test in new), "judged": judged}


def _noted(state: RunState, test: Test) -> Changes:
    """The nodes, with a finished test entered where it ran the whole environment of one."""
    node: Node | None = None
    round = state.round
    here = state.here
    if test.phase == CERTIFY:
        # Beside what is left, the whole world runs where that missed f, which would show its rate
        # as too low.
        beside = test.node != state.node and state.nodes[test.node].how in ("start", "instead")
        node = None if beside or test.without is not None else state.nodes[test.node]
    elif (
        round is not None
        and here is not None
        and test.candidate is not None
        and test.round == round.number
    ):
        # It ran ahead of the verdict that made its candidate the environment.
        node = here if round.winner == test.candidate and here.round == round.number else None
    if node is None or not test.is_sound:
        return {}
    after = replace(node, runs=(*node.runs, test.id), shown=node.shown + test.shows_f)
    return {"nodes": with_node(state.nodes, after)}


def same_runs(state: RunState, test: Test) -> Numbers:
    """The tests that were made for the same candidate, try or environment as `test`."""
    made_for = attrgetter("phase", "round", "candidate", "trial", "removal", "node", "without")
    return tuple(other.id for other in state.tests if made_for(other) == made_for(test))


def seen(tests: Sequence[Test], ids: Iterable[int]) -> tuple[Numbers, int]:
    """Those of some tests that ended and did not break, each once, and how many of them showed
    f.
    """
    sound = tuple(
        id for id in dict.fromkeys(ids) if 0 < id <= len(tests) and tests[id - 1].is_sound
    )
    return sound, sum(tests[id - 1].shows_f for id in sound)


def counted_again(nodes: Sequence[Node], tests: Sequence[Test]) -> tuple[Node, ...]:
    """The nodes after the outcomes of tests changed."""
    return tuple(replace(node, shown=seen(tests, node.runs)[1]) for node in nodes)


def with_node(nodes: Sequence[Node], node: Node) -> tuple[Node, ...]:
    """The nodes with this one in place of that with its number."""
    return (*nodes[: node.number], node, *nodes[node.number + 1 :])


def with_trial(state: RunState, trial: Trial) -> Changes:
    return {"trials": (*state.trials[: trial.number - 1], trial, *state.trials[trial.number :])}


def tried(state: RunState, event: e.OfCandidate) -> Candidate:
    """The candidate that an event is about. Raises IndexError or ValueError if it is none of the
    current round.
    """
    return candidate_of(state, event.round, event.candidate)


def candidate_of(state: RunState, number: int, index: int) -> Candidate:
    """A candidate of round `number`, as `tried`."""
    round = current(state)
    if number != round.number:
        raise ValueError(number)
    return round.candidates[index]


def with_candidate(state: RunState, candidate: Candidate) -> Changes:
    """The current round with `candidate` in place of the one with the same index."""
    round = current(state)
    return {
        "round": replace(round, candidates=round.candidates.changed(candidate.index, candidate))
    }


def current(state: RunState) -> Round:
    """The current round. Raises ValueError if none was started."""
    if state.round is None:
        raise ValueError("no round")
    return state.round
