"""What the events of tests change in a run's state: they start, end, are lost; the baseline's are compared with f."""

from __future__ import annotations

from dataclasses import replace

from ddenv.runfile.failures import as_now
from ddenv.runfile.fold_rounds import tried, with_candidate
from ddenv.runfile.guiding import Trial
from ddenv.runfile.state import Baseline, Point, RunState, Test
from ddenv.runfile.values import Changes, Data, chance, moments, names, number, vector


def test_started(state: RunState, data: Data, _: float) -> Changes:
    round, candidate = data["round"], data["candidate"]
    without = data.get("without")
    test = Test(
        id=int(data["test"]),
        phase=str(data["phase"]),
        round=round,
        candidate=candidate,
        run=int(data["run"]),
        seed=int(data["seed"]),
        without=None if without is None else names(state.elements, [without])[0],
        trial=data.get("trial"),
    )
    if test.id != len(state.tests) + 1:
        raise ValueError(test.id)
    changes = {"tests": state.tests.added(test), **_counts(state, None, test)}
    if test.trial is not None:
        return changes | {"trials": _with_test_of_trial(state, test)}
    if round is None:
        return changes
    if round != state.round.number:
        raise ValueError(round)
    one = tried(state, candidate)
    return changes | with_candidate(state, replace(one, tests=(*one.tests, test.id)))


def test_finished(state: RunState, data: Data, _: float) -> Changes:
    distance, pose = data["distance"], data["end_pose"]
    values = {
        "outcome": str(data["outcome"]),
        "failure": as_now(str(data["failure"])),
        "distance": None if distance is None else number(distance),
        "end_pose": None if pose is None else vector(pose, 7),
        "simulated_seconds": number(data["simulated_seconds"]),
        "wall_seconds": number(data["wall_seconds"]),
        "first_sensed": moments(state.elements, data.get("first_sensed", ())),
        "first_touched": moments(state.elements, data.get("first_touched", ())),
        "cut": bool(data.get("cut", False)),
        "taken": bool(data.get("taken", "")),
    }
    return _with_test(state, int(data["test"]), values)


def test_lost(state: RunState, data: Data, _: float) -> Changes:
    return _with_test(state, int(data["test"]), {"outcome": "lost"})


def baseline_finished(state: RunState, data: Data, _: float) -> Changes:
    baseline = Baseline(
        runs=int(data["runs"]),
        failures=int(data["failures"]),
        rate=chance(data["rate"]),
        low=chance(data["low"]),
        high=chance(data["high"]),
        failure_test=int(data["failure_test"]),
        position=vector(data["position"], 3),
        miss_chance=chance(data["miss_chance"]),
        iterations_95=int(data["iterations_95"]),
    )
    compared = with_outcomes(state, data)
    point = Point(compared.tests_done, len(state.environment))
    root = () if not state.nodes else (replace(state.nodes[0], evidence_test=baseline.failure_test),)
    return {
        "tests": compared.tests,
        "tally": compared.tally,
        "deflake_runs": compared.deflake_runs,
        "baseline": baseline,
        "evidence_test": baseline.failure_test,
        "failures": (baseline.failure_test,),
        "nodes": (*root, *state.nodes[1:]),
        "history": (*state.history, point),
        "status": state.status if state.paused else "running",
    }


def with_outcomes(state: RunState, data: Data) -> RunState:
    """The state with what tests turned out to be, now that f is known, or that another failure counts as f."""
    for test, outcome in data["outcomes"].items():
        distance = data["distances"].get(test)
        values = {"outcome": str(outcome), "distance": None if distance is None else number(distance)}
        state = state.changed(**_with_test(state, int(test), values))
    return state


def _with_test_of_trial(state: RunState, test: Test) -> tuple[Trial, ...]:
    if type(test.trial) is not int or not 0 < test.trial <= len(state.trials):
        raise IndexError(test.trial)
    trials = list(state.trials)
    trial = trials[test.trial - 1]
    trials[test.trial - 1] = replace(trial, tests=(*trial.tests, test.id))
    return tuple(trials)


def _with_test(state: RunState, id: int, values: Data) -> Changes:
    if id < 1:
        raise IndexError(id)
    before = state.tests[id - 1]
    after = replace(before, **values)
    return {"tests": state.tests.changed(id - 1, after), **_counts(state, before, after)}


def _counts(state: RunState, before: Test | None, after: Test) -> Changes:
    tally, reruns = dict(state.tally), state.deflake_runs + after.is_deflake_run
    # An outcome that nobody knows has no entry: a KeyError, and a tally that no file can make long.
    tally[after.outcome] += 1
    if before is not None:
        tally[before.outcome] -= 1
        reruns -= before.is_deflake_run
    return {"tally": tally, "deflake_runs": reruns}
