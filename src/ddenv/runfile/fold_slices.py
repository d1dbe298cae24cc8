"""Folds what slices do: a test that another one implies, an environment cut down to its slice, an audit that found a difference."""

from __future__ import annotations

from dataclasses import replace

from ddenv.runfile.atlas import models_of
from ddenv.runfile.events import Changes, Data, whole
from ddenv.runfile.fold_decisions import arrived, counts, here, searched_anew
from ddenv.runfile.progress import Node, Point
from ddenv.runfile.state import BROKEN, RunState, Test


def result_of(state: RunState, source: int) -> Data:
    """The result of the last test, which the finished test `source` implies."""
    if source < 1:
        raise IndexError(source)
    test, made = state.tests[-1], state.tests[source - 1]
    if not made.is_finished or made.outcome in BROKEN or made.implied_by is not None or made.run != test.run:
        raise ValueError(source)
    there = frozenset(models_of(state, test))
    return {
        "outcome": made.outcome,
        "failure": made.failure,
        "distance": made.distance,
        "end_pose": made.end_pose,
        "simulated_seconds": made.simulated_seconds,
        # The robot may have had others in view.
        "first_sensed": tuple(one for one in made.first_sensed if one[0] in there),
        "first_touched": made.first_touched,
        "cut": made.cut,
        "took_part": made.took_part,
        "implied_by": source,
    }


def sliced(state: RunState, data: Data, at: float) -> Changes:
    """The environment is cut down to what took part in the runs known there."""
    tests = tuple(map(whole, data["tests"]))
    if not tests or any(state.tests[test - 1].took_part is None or test < 1 for test in tests):
        raise ValueError(tests)
    changes = arrived(state, data, at, "sliced", "the slice", ())
    *others, last = changes["nodes"]
    return changes | {"nodes": (*others, replace(last, sliced_by=tests, to_audit=bool(data["audit"])))}


def slices_refuted(state: RunState, data: Data, _: float) -> Changes:
    """An implied test, simulated after all, does not have the bits of the run that implies it.

    The results of all implied tests are void. The run goes back to the last environment that rests on none.
    """
    audit, source, node = state.tests[whole(data["test"]) - 1], whole(data["by"]), here(state, data["node"])
    if audit.audits != source or any(rests_on_slices(state, each) for each in _path(state, node)):
        raise ValueError(source)
    for test in state.tests:
        if test.implied_by is not None and test.is_finished:
            after = replace(test, outcome="lost", tried=None)
            state = state.changed(tests=state.tests.changed(test.id - 1, after), **counts(state, test, after))
    state = state.changed(
        nodes=tuple(_without_void(each, state) for each in state.nodes),
        trials=tuple(
            replace(trial, verdict="", tests=(), known=0) if _any_implied(state, trial.tests) else trial
            for trial in state.trials
        ),
    )
    done = state.tests_done
    now = Point(done, len(node.environment))
    return {
        "tests": state.tests,
        "tally": state.tally,
        "deflake_runs": state.deflake_runs,
        "trials": state.trials,
        **searched_anew(state),
        "implied": 0,
        "refuted": (audit.id, source),
        "node": node.number,
        "environment": node.environment,
        "evidence_test": node.evidence_test,
        "came_at": done,
        "lower_bound": 0,
        # Void tests are no longer counted.
        "history": (*(replace(point, tests=min(point.tests, done)) for point in state.history), now),
    }


def rests_on_slices(state: RunState, node: Node) -> bool:
    """Whether a node was reached by implied tests, or by a slice."""
    return node.how == "sliced" or _any_implied(state, (*node.runs, node.evidence_test or 0))


def _any_implied(state: RunState, tests: tuple[int, ...]) -> bool:
    return any(state.tests[test - 1].implied_by is not None for test in tests if test > 0)


def _path(state: RunState, node: Node) -> tuple[Node, ...]:
    return state.changed(node=node.number).path


def _without_void(node: Node, state: RunState) -> Node:
    """A node without the runs whose results are void."""
    if not _any_implied(state, node.runs):
        return node
    runs: list[Test] = [state.tests[test - 1] for test in node.runs if state.tests[test - 1].implied_by is None]
    return replace(node, runs=tuple(test.id for test in runs), shown=sum(test.outcome == "similar" for test in runs))
