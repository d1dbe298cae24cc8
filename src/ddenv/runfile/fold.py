"""Events to state: `apply(state, event)` gives the next state and touches nothing else.

The kinds of events, with their data (models are numbers into the run's `elements`):

    created              scenario {...}, elements [names]
    engine_started       pid, jobs, version (of ddenv), simulator (what computes); both absent in older files
    test_started         test, phase, round, candidate, run, seed; where phase is "confirm" also without: model or null,
                         where it is "hand" trial
    test_finished        test, outcome, failure, distance, end_pose, simulated_seconds, wall_seconds,
                         first_sensed [[model, s]], first_touched [[model, s]] (both absent in files of version 1),
                         cut (absent before version 3), taken: the run that it was taken over from (absent where it was
                         made); trajectories beside it
    test_lost            test: it was running when the engine died
    baseline_finished    the fields of `Baseline`, and outcomes {test: outcome}, distances {test: m}
    leg_started          round: the number of the next one, n_partitions: a new search begins after the user changed something
    round_started        round, n_partitions, environment [..], partitions [[..]], candidates [[kind, partition, distance or null]],
                         pinned [..] (absent where there are none)
    candidate_judged     candidate, verdict, tests [ids], known
    waiting              candidate
    decided              candidate, decision: accept or reject
    reduced              candidate, environment [..], evidence_test
    round_finished
    confirm_started      the rounds are over, and what is left is run in full
    paused / resumed
    accept_mode          mode
    vetoed               candidate, verdict: vetoed, or rejected if the same models were rejected in an earlier round, which
                         `again` says
    unvetoed             round, candidate
    pinned / unpinned    models [..]
    trial_started        trial, models [..]: the user's own selection is tried
    trial_judged         trial, verdict, tests [ids], known
    adopted              trial, environment [..], evidence_test
    accepted_other       test, what, trial or null, environment [..], outcomes {test: outcome}, distances {test: m}
    went_back            node, rejected: the node that is undone, or null; outcomes and distances of tests where other failures
                         count there
    changed              settings {...}: keys of the scenario's section `reduction`
    command_refused      why
    command_handled      command: no other event came of it
    finished             minimal, reason
    engine_stopped       reason
    engine_failed        reason

An event that a viewer's command became also holds `command`, its number.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

from ddenv.errors import UserError
from ddenv.runfile import fold_guiding, fold_nodes, fold_rounds, fold_tests
from ddenv.runfile.guiding import Node
from ddenv.runfile.state import Point, RunState
from ddenv.runfile.store import Event
from ddenv.runfile.values import Changes, Data, one_of


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
        changes = handler(state, event.data, event.time)
        if (command := event.data.get("command")) is not None:
            changes["last_command"] = max(state.last_command, int(command))
    except (KeyError, TypeError, ValueError, IndexError, AttributeError, OverflowError, RecursionError):
        raise UserError(f"damaged run file: event {event.id} ({event.kind}) makes no sense here") from None
    return state.changed(revision=event.id, updated_at=event.time, **changes)


def _created(state: RunState, data: Data, _: float) -> Changes:
    if state.tests or len(state.nodes) > 1 or state.round is not None:
        raise ValueError("it was made before")
    elements = tuple(str(name) for name in data["elements"])
    return {
        "scenario": dict(data["scenario"]),
        "elements": elements,
        "environment": elements,
        "history": (Point(0, len(elements)),),
        "nodes": (Node(0, None, "start", "the whole world", elements),),
    }


def _engine_started(state: RunState, data: Data, at: float) -> Changes:
    # An engine that was killed told no end: it worked at least until its last event.
    spent = 0.0 if state.started_at is None else max(0.0, state.updated_at - state.started_at)
    return {
        "status": "baseline" if state.baseline is None else "running",
        "reason": "",
        "paused": False,
        "waiting_candidate": None,
        "confirming": False,
        "jobs": int(data["jobs"]),
        "engine_version": str(data.get("version", "")),
        "simulator": str(data.get("simulator", "")),
        "started_at": at,
        "working_seconds": state.working_seconds + spent,
    }


def _confirm_started(_: RunState, __: Data, ___: float) -> Changes:
    return {"confirming": True}


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
    return {"accept_mode": mode, **fold_nodes.decision(state, at, "accept_mode", words)}


def _command_handled(state: RunState, data: Data, _: float) -> Changes:
    return {"last_command": max(state.last_command, int(data["command"]))}


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


def _engine_stopped(state: RunState, data: Data, at: float) -> Changes:
    return _ended(state, "stopped", data, at)


def _engine_failed(state: RunState, data: Data, at: float) -> Changes:
    return _ended(state, "failed", data, at)


def _ended(state: RunState, status: str, data: Data, at: float) -> Changes:
    spent = 0.0 if state.started_at is None else max(0.0, at - state.started_at)
    return {
        "status": status,
        "reason": str(data["reason"]),
        "waiting_candidate": None,
        "paused": False,
        "working_seconds": state.working_seconds + spent,
        "started_at": None,
    }


# Each tells the fields that get other values, so that the state is copied once an event.
_HANDLERS: dict[str, Callable[[RunState, Data, float], Changes]] = {
    "created": _created,
    "engine_started": _engine_started,
    "test_started": fold_tests.test_started,
    "test_finished": fold_tests.test_finished,
    "test_lost": fold_tests.test_lost,
    "baseline_finished": fold_tests.baseline_finished,
    "round_started": fold_rounds.round_started,
    "candidate_judged": fold_rounds.candidate_judged,
    "waiting": fold_rounds.waiting,
    "decided": fold_rounds.decided,
    "reduced": fold_rounds.reduced,
    "round_finished": fold_rounds.round_finished,
    "confirm_started": _confirm_started,
    "paused": _paused,
    "resumed": _resumed,
    "accept_mode": _accept_mode,
    "vetoed": fold_rounds.vetoed,
    "unvetoed": fold_rounds.unvetoed,
    "pinned": fold_guiding.pinned,
    "unpinned": fold_guiding.unpinned,
    "trial_started": fold_guiding.trial_started,
    "trial_judged": fold_guiding.trial_judged,
    "adopted": fold_guiding.adopted,
    "accepted_other": fold_guiding.accepted_other,
    "went_back": fold_guiding.went_back,
    "changed": fold_guiding.changed,
    "leg_started": fold_guiding.leg_started,
    "command_refused": fold_guiding.command_refused,
    "command_handled": _command_handled,
    "finished": _finished,
    "engine_stopped": _engine_stopped,
    "engine_failed": _engine_failed,
}
