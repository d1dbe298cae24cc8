"""Events to state: `apply(state, event)` gives the next state and touches nothing else.

The kinds of events, with their data (models are numbers into the run's `elements`):

    created              scenario {...}, elements [names]
    engine_started       pid, jobs
    test_started         test, phase, round, candidate, run, seed
    test_finished        test, outcome, failure, distance, end_pose, simulated_seconds, wall_seconds (trajectories beside it)
    test_lost            test: it was running when the engine died
    baseline_finished    the fields of `Baseline`, and outcomes {test: outcome}, distances {test: m}
    round_started        round, n_partitions, environment [..], partitions [[..]], candidates [[kind, partition, distance or null]]
    candidate_judged     candidate, verdict, tests [ids], known
    waiting              candidate
    decided              candidate, decision: accept or reject
    reduced              candidate, environment [..], evidence_test
    round_finished
    paused / resumed
    accept_mode          mode
    vetoed               candidate, verdict: vetoed, or rejected if the same models were rejected in an earlier round
    command_handled      command
    finished             minimal, reason
    engine_stopped       reason
    engine_failed        reason
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

from ddenv.errors import UserError
from ddenv.runfile.state import Baseline, Candidate, Point, Round, RunState, Test
from ddenv.runfile.store import Event

Data = dict[str, Any]
Names = tuple[str, ...]


def fold(events: Iterable[Event], state: RunState | None = None) -> RunState:
    """The state after `events`, from the beginning or from an earlier `state`. Raises UserError for events that make no sense."""
    state = state or RunState()
    for event in events:
        state = apply(state, event)
    return state


def apply(state: RunState, event: Event) -> RunState:
    """The state after one more event. Raises UserError for an event that makes no sense here."""
    handler = _HANDLERS.get(event.kind)
    if handler is None:
        raise UserError(f"damaged run file: event {event.id} is of an unknown kind {event.kind[:40]!a}")
    try:
        state = handler(state, event.data, event.time)
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError, RecursionError):
        raise UserError(f"damaged run file: event {event.id} ({event.kind}) makes no sense here") from None
    return replace(state, revision=event.id, updated_at=event.time)


def _created(state: RunState, data: Data, _: float) -> RunState:
    elements = tuple(str(name) for name in data["elements"])
    points = (Point(0, len(elements)),)
    return replace(state, scenario=dict(data["scenario"]), elements=elements, environment=elements, history=points)


def _engine_started(state: RunState, data: Data, at: float) -> RunState:
    status = "baseline" if state.baseline is None else "running"
    # An engine that was killed told no end: it worked at least until its last event.
    spent = 0.0 if state.started_at is None else max(0.0, state.updated_at - state.started_at)
    return replace(
        state,
        status=status,
        reason="",
        paused=False,
        waiting_candidate=None,
        jobs=int(data["jobs"]),
        started_at=at,
        working_seconds=state.working_seconds + spent,
    )


def _test_started(state: RunState, data: Data, _: float) -> RunState:
    round, candidate = data["round"], data["candidate"]
    test = Test(int(data["test"]), str(data["phase"]), round, candidate, int(data["run"]), int(data["seed"]))
    if test.id != len(state.tests) + 1:
        raise ValueError(test.id)
    state = replace(state, tests=(*state.tests, test))
    if round is None:
        return state
    if round != state.round.number:
        raise ValueError(round)
    tried = _candidate(state, candidate)
    return _with_candidate(state, replace(tried, tests=(*tried.tests, test.id)))


def _test_finished(state: RunState, data: Data, _: float) -> RunState:
    distance, pose = data["distance"], data["end_pose"]
    values = {
        "outcome": str(data["outcome"]),
        "failure": str(data["failure"]),
        "distance": None if distance is None else _number(distance),
        "end_pose": None if pose is None else _vector(pose, 7),
        "simulated_seconds": _number(data["simulated_seconds"]),
        "wall_seconds": _number(data["wall_seconds"]),
    }
    return _with_test(state, int(data["test"]), values)


def _test_lost(state: RunState, data: Data, _: float) -> RunState:
    return _with_test(state, int(data["test"]), {"outcome": "lost"})


def _baseline_finished(state: RunState, data: Data, _: float) -> RunState:
    for test, outcome in data["outcomes"].items():
        distance = data["distances"].get(test)
        values = {"outcome": str(outcome), "distance": None if distance is None else _number(distance)}
        state = _with_test(state, int(test), values)
    baseline = Baseline(
        runs=int(data["runs"]),
        failures=int(data["failures"]),
        rate=_number(data["rate"]),
        low=_number(data["low"]),
        high=_number(data["high"]),
        failure_test=int(data["failure_test"]),
        position=_vector(data["position"], 3),
        miss_chance=_number(data["miss_chance"]),
        iterations_95=int(data["iterations_95"]),
    )
    point = Point(len(state.finished_tests), len(state.environment))
    state = replace(state, baseline=baseline, evidence_test=baseline.failure_test, history=(*state.history, point))
    return state if state.paused else replace(state, status="running")


def _round_started(state: RunState, data: Data, _: float) -> RunState:
    environment = _names(state, data["environment"])
    partitions = tuple(_names(state, part) for part in data["partitions"])
    _check_partitions(environment, partitions, data["candidates"])
    candidates = []
    for index, (kind, partition, distance) in enumerate(data["candidates"]):
        models = partitions[partition]
        if kind == "complement":
            part = frozenset(models)
            models = tuple(name for name in environment if name not in part)
        distance = None if distance is None else _number(distance)
        candidates.append(Candidate(index, str(kind), int(partition), models, distance))
    number, n_partitions = int(data["round"]), int(data["n_partitions"])
    return replace(state, round=Round(number, n_partitions, environment, partitions, tuple(candidates)))


def _check_partitions(environment: Names, partitions: tuple[Names, ...], candidates: list) -> None:
    """Partitions are disjoint and within the environment, and each makes at most two candidates: there are not many."""
    models = [name for partition in partitions for name in partition]
    if len(set(models)) != len(models) or not set(models) <= set(environment) or not all(partitions):
        raise ValueError("partitions")
    if len({(kind, partition) for kind, partition, _ in candidates}) != len(candidates):
        raise ValueError("candidates")
    if not all(kind in ("partition", "complement") and 0 <= part < len(partitions) for kind, part, _ in candidates):
        raise ValueError("candidates")


def _candidate_judged(state: RunState, data: Data, _: float) -> RunState:
    candidate = _candidate(state, data["candidate"])
    tests, known = tuple(map(int, data["tests"])), int(data["known"])
    return _with_candidate(state, replace(candidate, verdict=str(data["verdict"]), tests=tests, known=known))


def _waiting(state: RunState, data: Data, _: float) -> RunState:
    return replace(state, status="waiting", waiting_candidate=_candidate(state, data["candidate"]).index)


def _decided(state: RunState, data: Data, _: float) -> RunState:
    status = "paused" if state.paused else "running"
    state = replace(state, status=status, waiting_candidate=None)
    if data["decision"] == "accept":
        return state
    return _with_candidate(state, replace(_candidate(state, data["candidate"]), verdict="rejected"))


def _reduced(state: RunState, data: Data, _: float) -> RunState:
    environment = _names(state, data["environment"])
    history = (*state.history, Point(len(state.finished_tests), len(environment)))
    won = replace(state.round, winner=_candidate(state, data["candidate"]).index)
    test = int(data["evidence_test"])
    return replace(state, environment=environment, round=won, history=history, evidence_test=test)


def _round_finished(state: RunState, _: Data, __: float) -> RunState:
    return replace(state, round=replace(state.round, done=True), rounds_done=state.round.number)


def _paused(state: RunState, _: Data, __: float) -> RunState:
    return replace(state, paused=True, status=state.status if state.status == "waiting" else "paused")


def _resumed(state: RunState, _: Data, __: float) -> RunState:
    working = "baseline" if state.baseline is None else "running"
    return replace(state, paused=False, status=working if state.status == "paused" else state.status)


def _accept_mode(state: RunState, data: Data, _: float) -> RunState:
    return replace(state, accept_mode=str(data["mode"]))


def _vetoed(state: RunState, data: Data, _: float) -> RunState:
    verdict = str(data["verdict"])
    return _with_candidate(state, replace(_candidate(state, data["candidate"]), verdict=verdict))


def _command_handled(state: RunState, data: Data, _: float) -> RunState:
    return replace(state, last_command=max(state.last_command, int(data["command"])))


def _finished(state: RunState, data: Data, at: float) -> RunState:
    history = (*state.history, Point(len(state.finished_tests), len(state.environment)))
    state = _ended(state, "finished", data, at)
    return replace(state, minimal=bool(data["minimal"]), history=history)


def _engine_stopped(state: RunState, data: Data, at: float) -> RunState:
    return _ended(state, "stopped", data, at)


def _engine_failed(state: RunState, data: Data, at: float) -> RunState:
    return _ended(state, "failed", data, at)


def _ended(state: RunState, status: str, data: Data, at: float) -> RunState:
    spent = 0.0 if state.started_at is None else max(0.0, at - state.started_at)
    seconds = state.working_seconds + spent
    return replace(
        state,
        status=status,
        reason=str(data["reason"]),
        waiting_candidate=None,
        paused=False,
        working_seconds=seconds,
        started_at=None,
    )


def _with_test(state: RunState, id: int, values: Data) -> RunState:
    if id < 1:
        raise IndexError(id)
    changed = replace(state.tests[id - 1], **values)
    return replace(state, tests=(*state.tests[: id - 1], changed, *state.tests[id:]))


def _with_candidate(state: RunState, candidate: Candidate) -> RunState:
    candidates = state.round.candidates
    changed = (*candidates[: candidate.index], candidate, *candidates[candidate.index + 1 :])
    return replace(state, round=replace(state.round, candidates=changed))


def _candidate(state: RunState, index: int) -> Candidate:
    if not 0 <= index < len(state.round.candidates):
        raise IndexError(index)
    return state.round.candidates[index]


def _number(value: Any) -> float:
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(value)
    return number


def _vector(values: Any, length: int) -> tuple[float, ...]:
    vector = tuple(_number(value) for value in values)
    if len(vector) != length:
        raise ValueError(values)
    return vector


def _names(state: RunState, numbers: list[int]) -> tuple[str, ...]:
    if any(number < 0 for number in numbers):
        raise IndexError(numbers)
    return tuple(state.elements[number] for number in numbers)


_HANDLERS: dict[str, Callable[[RunState, Data, float], RunState]] = {
    "created": _created,
    "engine_started": _engine_started,
    "test_started": _test_started,
    "test_finished": _test_finished,
    "test_lost": _test_lost,
    "baseline_finished": _baseline_finished,
    "round_started": _round_started,
    "candidate_judged": _candidate_judged,
    "waiting": _waiting,
    "decided": _decided,
    "reduced": _reduced,
    "round_finished": _round_finished,
    "paused": _paused,
    "resumed": _resumed,
    "accept_mode": _accept_mode,
    "vetoed": _vetoed,
    "command_handled": _command_handled,
    "finished": _finished,
    "engine_stopped": _engine_stopped,
    "engine_failed": _engine_failed,
}
