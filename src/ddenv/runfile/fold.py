"""Folds events into the state of a run. Pure: `apply(state, event)` returns the next state."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import reduce
from typing import Any

from ddenv.amounts import count
from ddenv.errors import UserError
from ddenv.runfile import (
    fold_ahead,
    fold_baseline,
    fold_certificates,
    fold_decisions,
    fold_isolation,
    fold_rates,
    fold_slices,
    supports,
    working,
)
from ddenv.runfile.events import Changes, Data, as_it_was, moments, names, number, one_of, vector, whole
from ddenv.runfile.fold_decisions import arrived, counts, decision, here, waits_no_more, with_test
from ddenv.runfile.persistent import PersistentTuple
from ddenv.runfile.progress import Forecast, Point
from ddenv.runfile.state import REFUSED, Candidate, Node, Round, RunState, Split, Test, Trial
from ddenv.runfile.store import Event, uncollected


def fold(events: Iterable[Event], state: RunState | None = None) -> RunState:
    """The state after `events`, from the beginning or from an earlier `state`. Raises UserError for invalid events."""
    with uncollected():
        return reduce(apply, events, state or RunState())


def apply(state: RunState, event: Event) -> RunState:
    """The state after one more event. Raises UserError if the event is not valid in this state."""
    handler = _HANDLERS.get(event.kind)
    if handler is None:
        raise UserError(f"damaged run file: event {event.id} is of an unknown kind {event.kind[:40]!a}")
    try:
        changes = fold_ahead.counted(state, event.kind, event.data, handler(state, event.data, event.time))
        if (command := event.data.get("command")) is not None:
            changes["last_command"] = max(state.last_command, int(command))
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError, RecursionError):
        raise UserError(f"damaged run file: event {event.id} ({event.kind}) is invalid here") from None
    return working.counted(state, state.changed(revision=event.id, updated_at=event.time, **changes))


def _created(state: RunState, data: Data, _: float) -> Changes:
    if state.tests or len(state.nodes) > 1 or state.round is not None:
        raise ValueError("a second created")
    elements = tuple(str(name) for name in data["elements"])
    return {
        "scenario": as_it_was(dict(data["scenario"])),
        "elements": elements,
        "environment": elements,
        "history": (Point(0, len(elements)),),
        "nodes": (Node(0, None, "start", "the whole world", elements),),
    }


def _engine_started(state: RunState, data: Data, at: float) -> Changes:
    return {
        # A killed engine wrote no end: it worked at least until its last event.
        **working.stopped(state, state.updated_at),
        "status": "baseline" if state.baseline is None else "running",
        "reason": "",
        "paused": False,
        "needs_room": 0,
        "waiting_candidate": None,
        "confirming": state.certificate is not None and not state.certificate.claims,
        "settling": False,
        "jobs": whole(data["jobs"]),
        "engine_version": str(data["version"]),
        "simulator": str(data["simulator"]),
        "physics": state.physics.started(data, state.tests_done),
        "started_at": at,
    }


def _noted(state: RunState, data: Data, _: float) -> Changes:
    return {"notes": (*state.notes, (str(data["about"]), str(data["words"])))}


def _test_started(state: RunState, data: Data, _: float) -> Changes:
    round, candidate = data["round"], data["candidate"]
    without = data.get("without")
    tried = fold_ahead.tried(state, data) if round is None else _tried(state, candidate)
    test = Test(
        id=whole(data["test"]),
        phase=str(data["phase"]),
        round=round,
        candidate=candidate,
        run=whole(data["run"]),
        seed=whole(data["seed"]),
        without=None if without is None else names(state.elements, [without])[0],
        trial=data.get("trial"),
        removal=fold_isolation.removal_of(state, data),
        audits=data.get("audits"),
        node=data.get("node", state.node),
        tried=tried,
    )
    # Raises IndexError if there is none.
    here(state, test.node)
    if test.id != len(state.tests) + 1:
        raise ValueError(test.id)
    more = {"audits": state.audits + (test.audits is not None), **fold_certificates.with_fresh(state, test)}
    changes = {"tests": state.tests.added(test), **counts(state, None, test), **more}
    if test.trial is not None:
        return changes | {"trials": _with_test_of_trial(state, test)}
    if round is None or tried is None:
        return changes
    if round != _current(state).number:
        raise ValueError(round)
    return changes | _with_candidate(state, replace(tried, tests=(*tried.tests, test.id)))


def _test_finished(state: RunState, data: Data, _: float) -> Changes:
    distance, pose = data["distance"], data["end_pose"]
    values = {
        "outcome": str(data["outcome"]),
        "failure": str(data["failure"]),
        "distance": None if distance is None else number(distance),
        "end_pose": None if pose is None else vector(pose, 7),
        "simulated_seconds": number(data["simulated_seconds"]),
        "wall_seconds": number(data["wall_seconds"]),
        "first_sensed": moments(state.elements, data["first_sensed"]),
        "first_touched": moments(state.elements, data["first_touched"]),
        "cut": bool(data["cut"]),
        "took_part": None if data.get("took_part") is None else frozenset(names(state.elements, data["took_part"])),
        "taken": "taken" in data,
    }
    return _ended_as(state, whole(data["test"]), values)


def _ended_as(state: RunState, test: int, values: Data) -> Changes:
    if values["outcome"] not in ("similar", "other"):
        # Few tests fail: the rounds of all others need not be kept.
        values["tried"] = None
    changes = with_test(state, test, values)
    return changes | fold_rates.noted(state, changes["tests"][test - 1])


def _implied(state: RunState, data: Data, at: float) -> Changes:
    """A test that starts and ends at once."""
    started = _test_started(state, data, at)
    now = state.changed(**started)
    ended = _ended_as(now, len(now.tests), fold_slices.result_of(now, whole(data["by"])))
    return {**started, **ended, "implied": state.implied + 1}


def _test_lost(state: RunState, data: Data, _: float) -> Changes:
    changes = with_test(state, whole(data["test"]), {"outcome": "lost"})
    lost = state.tests[whole(data["test"]) - 1]
    return changes | {"audits": state.audits - (lost.audits is not None)}


def _round_started(state: RunState, data: Data, _: float) -> Changes:
    environment = names(state.elements, data["environment"])
    partitions = tuple(names(state.elements, part) for part in data["partitions"])
    split = Split(environment, partitions, names(state.elements, data.get("pinned", ())))
    _check(split, data["candidates"])
    if state.round is not None and whole(data["round"]) <= state.round.number:
        raise ValueError(data["round"])
    candidates = PersistentTuple.of(
        Candidate(index, kind, partition, split, None if distance is None else number(distance))
        for index, (kind, partition, distance) in enumerate(data["candidates"])
    )
    round = Round(whole(data["round"]), whole(data["n_partitions"]), split, candidates)
    return {**waits_no_more(state), "round": round}


def _forecast(_: RunState, data: Data, __: float) -> Changes:
    low, likely, high = (whole(number(tests)) for tests in data["tests"])
    found = Forecast(low, likely, high, whole(data["tests_done"]))
    if not 0 <= low <= likely <= high or found.tests_done < 0:
        raise ValueError(data)
    return {"forecast": found}


def _candidate_judged(state: RunState, data: Data, _: float) -> Changes:
    candidate = replace(
        _tried(state, data["candidate"]),
        verdict=one_of(data["verdict"], "similar", "missed", "dissimilar", "unknown"),
        tests=tuple(map(whole, data["tests"])),
        known=whole(data["known"]),
    )
    round = _with(_current(state), candidate)
    # Without tests it is part of what has lost the rate.
    if candidate.verdict != "dissimilar" or not candidate.tests:
        return {"round": round}
    # Something in the part that it leaves out is needed, and these parts are disjoint.
    apart = candidate.kind == "complement" or len(round.partitions) == 2
    round = replace(round, missed=round.missed + apart)
    needed = min(max(state.lower_bound, round.missed, 1), len(round.environment))
    if needed == state.lower_bound:
        return {"round": round}
    point = Point(state.tests_done, len(state.environment), needed)
    return {"round": round, "lower_bound": needed, "history": (*state.history, point)}


def _waiting(state: RunState, data: Data, _: float) -> Changes:
    return {"status": "waiting", "waiting_candidate": _tried(state, data["candidate"]).index}


def _decided(state: RunState, data: Data, at: float) -> Changes:
    changes = {"status": "paused" if state.paused else "running", "waiting_candidate": None}
    candidate = _tried(state, data["candidate"])
    said = f"{'accepted' if data['decision'] == 'accept' else 'rejected'} {_described(state, candidate)}"
    changes |= decision(state, at, str(data["decision"]), said)
    if data["decision"] == "accept":
        return changes
    return changes | _with_candidate(state, replace(candidate, verdict="rejected"))


def _reduced(state: RunState, data: Data, at: float) -> Changes:
    winner = _tried(state, data["candidate"])
    # One part alone shows f although several seemed to be needed: the lower bound was wrong.
    if winner.kind == "partition" and _current(state).missed > 1:
        state = state.changed(lower_bound=0)
    changes = arrived(state, data, at, "reduced", winner.label, winner.tests)
    return changes | {"round": replace(_current(state), winner=winner.index)}


def _round_finished(state: RunState, _: Data, __: float) -> Changes:
    round = _current(state)
    return {"round": replace(round, done=True), "rounds_done": round.number}


def _paused(state: RunState, _: Data, __: float) -> Changes:
    return {"paused": True, "status": state.status if state.status == "waiting" else "paused"}


def _resumed(state: RunState, _: Data, __: float) -> Changes:
    working = "baseline" if state.baseline is None else "running"
    return {"paused": False, "status": working if state.status == "paused" else state.status}


def _accept_mode(state: RunState, data: Data, at: float) -> Changes:
    mode = one_of(data["mode"], "automatic", "ask")
    if mode == state.accept_mode:
        return {}
    words = "reductions wait for accept or reject" if mode == "ask" else "reductions are accepted automatically"
    return {"accept_mode": mode, **fold_decisions.decision(state, at, "accept_mode", words)}


def _vetoed(state: RunState, data: Data, at: float) -> Changes:
    verdict = one_of(data["verdict"], *REFUSED)
    candidate = replace(_tried(state, data["candidate"]), verdict=verdict)
    changes = _with_candidate(state, candidate)
    if data.get("again"):
        return changes
    return changes | decision(state, at, "veto", f"vetoed {_described(state, candidate)}")


def _unvetoed(state: RunState, data: Data, at: float) -> Changes:
    candidate = _tried(state, data["candidate"])
    words = f"took back the veto of {_described(state, candidate)}"
    if candidate.verdict == "rejected":
        words = f"took back the rejection of {_described(state, candidate)}"
    if candidate.verdict == "undone":
        words = f"allowed {_described(state, candidate)} again"
    changes = _with_candidate(state, replace(candidate, verdict="")) | decision(state, at, "unveto", words)
    # The first similar candidate wins: a later one must wait for the verdict of this one.
    if state.waiting_candidate is not None and state.waiting_candidate > candidate.index:
        changes |= waits_no_more(state)
    return changes


def _finished(state: RunState, data: Data, at: float) -> Changes:
    minimal, size = bool(data["minimal"]), len(state.environment)
    nodes = list(state.nodes)
    if nodes:
        nodes[state.node] = replace(nodes[state.node], minimal=minimal)
    return {
        **_ended(state, "finished", data, at),
        "minimal": minimal,
        "nodes": tuple(nodes),
        "history": (*state.history, Point(state.tests_done, size, min(size, state.lower_bound))),
    }


# Each returns only the changed fields, so that the state is copied once per event.
_HANDLERS: dict[str, Callable[[RunState, Data, float], Changes]] = {
    "created": _created,
    "engine_started": _engine_started,
    "comparing": lambda *_: {},
    "compared": lambda state, data, _: {"physics": state.physics.compared(bool(data["same"]))},
    "supports_started": supports.supports_started,
    "supports": supports.supports,
    "noted": _noted,
    "test_started": _test_started,
    "test_finished": _test_finished,
    "implied": _implied,
    "still": lambda *_: {"ties": ()},
    "sliced": fold_slices.sliced,
    "slices_refuted": fold_slices.slices_refuted,
    "test_lost": _test_lost,
    "baseline_finished": fold_baseline.baseline_finished,
    "round_started": _round_started,
    "forecast": _forecast,
    "candidate_judged": _candidate_judged,
    "waiting": _waiting,
    "decided": _decided,
    "reduced": _reduced,
    "round_finished": _round_finished,
    "confirm_started": lambda *_: {"confirming": True},
    "certificate_started": fold_certificates.certificate_started,
    "certificate_finished": fold_certificates.certificate_finished,
    "rate_lost": fold_certificates.rate_lost,
    "left_out": fold_certificates.left_out,
    "paused": _paused,
    "resumed": _resumed,
    **working.HANDLERS,
    **fold_isolation.HANDLERS,
    "accept_mode": _accept_mode,
    "vetoed": _vetoed,
    "unvetoed": _unvetoed,
    "pinned": fold_decisions.pinned,
    "unpinned": fold_decisions.unpinned,
    "trial_started": fold_decisions.trial_started,
    "trial_judged": fold_decisions.trial_judged,
    "adopted": fold_decisions.adopted,
    "accepted_other": fold_decisions.accepted_other,
    "went_back": fold_decisions.went_back,
    "changed": fold_decisions.changed,
    "leg_started": fold_decisions.leg_started,
    "command_refused": fold_decisions.command_refused,
    "command_handled": lambda state, data, _: {"last_command": max(state.last_command, whole(data["command"]))},
    "finished": _finished,
    "engine_stopped": lambda state, data, at: _ended(state, "stopped", data, at),
    "engine_failed": lambda state, data, at: _ended(state, "failed", data, at),
}


def _ended(state: RunState, status: str, data: Data, at: float) -> Changes:
    return {
        **working.stopped(state, at),
        "status": status,
        "reason": str(data["reason"]),
        "waiting_candidate": None,
        "paused": False,
    }


def _with_test_of_trial(state: RunState, test: Test) -> tuple[Trial, ...]:
    if type(test.trial) is not int or not 0 < test.trial <= len(state.trials):
        raise IndexError(test.trial)
    trials = list(state.trials)
    trial = trials[test.trial - 1]
    trials[test.trial - 1] = replace(trial, tests=(*trial.tests, test.id))
    return tuple(trials)


def _check(split: Split, candidates: list[Any]) -> None:
    """Raises ValueError unless partitions are disjoint and inside the environment, and candidates unique."""
    models = [*(name for partition in split.partitions for name in partition), *split.pinned]
    environment = set(split.environment)
    if len(set(models)) != len(models) or not environment.issuperset(models) or not all(split.partitions):
        raise ValueError("partitions")
    if len(environment) != len(split.environment):
        raise ValueError("environment")
    if len({(kind, partition) for kind, partition, _ in candidates}) != len(candidates):
        raise ValueError("candidates")
    numbers = range(len(split.partitions))
    if not all(
        kind in ("partition", "complement") and type(part) is int and part in numbers for kind, part, _ in candidates
    ):
        raise ValueError("candidates")


def _described(state: RunState, candidate: Candidate) -> str:
    return f"{candidate.label} of round {_current(state).number} ({count(candidate.size, 'model')})"


def _tried(state: RunState, index: int) -> Candidate:
    """The candidate of the current round with this index. Raises IndexError or ValueError if there is none."""
    if index < 0:
        raise IndexError(index)
    return _current(state).candidates[index]


def _with_candidate(state: RunState, candidate: Candidate) -> Changes:
    """The current round with `candidate` in place of the one with the same index."""
    return {"round": _with(_current(state), candidate)}


def _with(round: Round, candidate: Candidate) -> Round:
    return replace(round, candidates=round.candidates.changed(candidate.index, candidate))


def _current(state: RunState) -> Round:
    """The current round. Raises ValueError if none was started."""
    if state.round is None:
        raise ValueError("no round")
    return state.round
