"""Folds events into the state of a run. Pure: `apply(state, recorded)` returns the next state.

What each event changes stands here and in the files `fold_*.py` beside this one, a function for
each.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from functools import reduce
from typing import Any

from ddenv.environment import Environment
from ddenv.errors import UserError
from ddenv.runfile import events as e
from ddenv.runfile import fold_claims, fold_decisions, fold_tests
from ddenv.runfile.fold_decisions import arrived, decision, refused, waits_no_more
from ddenv.runfile.fold_tests import Changes, current, tried, with_candidate, with_node
from ddenv.runfile.progress import Node, PastRound, Point
from ddenv.runfile.state import Candidate, PersistentTuple, Round, RunState, Split, spent
from ddenv.runfile.store import Recorded
from ddenv.text import Data, count

# Verdicts that tests led to, not the user.
JUDGED = ("similar", "missed", "dissimilar", "unknown")


def fold(recorded: Iterable[Recorded], state: RunState | None = None) -> RunState:
    """The state after these events, from the beginning or from an earlier `state`. Raises UserError
    for invalid ones.
    """
    return reduce(apply, recorded, state or RunState())


def apply(state: RunState, recorded: Recorded) -> RunState:
    """The state after one more event. Raises UserError if the event is not valid in this state."""
    event = recorded.event
    try:
        changes = _HANDLERS[type(event)](state, event, recorded.time)
        changes |= fold_tests.rested_upon(state, event)
    except (
        KeyError,
        TypeError,
        ValueError,
        IndexError,
        AttributeError,
        OverflowError,
        RecursionError,
    ):
        raise UserError(
            f"damaged run file: event {recorded.id} ({recorded.kind}) is invalid here"
        ) from None
    if recorded.command is not None:
        changes["last_command"] = max(state.last_command, recorded.command)
        if isinstance(event, e.CommandRefused):
            changes["refusal"] = recorded.command, event.why
    after = state.changed(revision=recorded.id, updated_at=recorded.time, **changes)
    stood = _stands(state)
    stands = _stands(after)
    # The clock stops where the run stands still, and starts where it goes on.
    if stands and not stood:
        return after.changed(**_stopped(after, after.updated_at))
    if stood and not stands and not after.ended and after.started_at is None:
        return after.changed(started_at=after.updated_at)
    return after


def steps(
    events: Iterable[Recorded], state: RunState | None = None
) -> Iterator[tuple[Recorded, RunState, RunState]]:
    """(event, before, after) for each event, from the beginning or from an earlier `state`. Raises
    UserError at an invalid one.
    """
    after = state or RunState()
    for recorded in events:
        before = after
        after = apply(after, recorded)
        yield recorded, before, after


def recorded_scenario(scenario: Data) -> Data:
    """A scenario as a run file has it: where it does not say so, seeds were consecutive."""
    reduction = scenario.get("reduction")
    if isinstance(reduction, dict):
        return scenario | {"reduction": {"seeds": "consecutive"} | reduction}
    return scenario


def created(state: RunState, event: e.Created, _: float) -> Changes:
    if state.tests or len(state.nodes) > 1 or state.round is not None:
        raise ValueError("a second created")
    names = event.elements
    return {
        "scenario": recorded_scenario(event.scenario),
        "elements": names,
        "welds": tuple((names[first], names[second]) for first, second in event.welds),
        "environments": PersistentTuple.of([Environment.whole(len(names))]),
        "environment": names,
        "history": (Point(0, len(names)),),
        "nodes": (
            Node(number=0, parent=None, how="start", what="the whole world", environment=names),
        ),
    }


# The engine, and for how long it works: no pause counts, nor the time in which a reduction waits
# for the user or for the disk.


def engine_started(state: RunState, event: e.EngineStarted, at: float) -> Changes:
    # Tests that broke are made again; verdicts that rest on them may change, so the search starts
    # again.
    anew = state.left_unknown and state.baseline is not None
    return {
        # A killed engine wrote no end: it worked at least until its last event.
        **_stopped(state, state.updated_at),
        "status": "baseline" if state.baseline is None else "running",
        "reason": "",
        "paused": False,
        "needs_room": 0,
        "waiting_candidate": None,
        "confirming": state.certificate is not None and not state.certificate.claims,
        "settling": False,
        "jobs": event.jobs,
        "engines": state.engines + 1,
        "left_unknown": False,
        "search_due": state.search_due or anew,
        "engine_version": event.version,
        "simulator": event.simulator,
        "physics": state.physics.started(event, state.tests_done),
        "started_at": at,
    }


def compared(state: RunState, event: e.Compared, _: float) -> Changes:
    mixed_until = state.mixed_until if event.same else len(state.tests)
    return {"physics": state.physics.compared(event.same), "mixed_until": mixed_until}


def _ended(state: RunState, status: str, reason: str, at: float) -> Changes:
    return {
        **_stopped(state, at),
        "status": status,
        "reason": reason,
        "waiting_candidate": None,
        "paused": False,
    }


def engine_stopped(state: RunState, event: e.EngineStopped, at: float) -> Changes:
    """An isolation, or a search for margins, that is stopped leaves the reduction before it as it
    was.
    """
    if state.isolating is not None or state.margining is not None:
        return _as_it_was(state, at)
    return _ended(state, "stopped", event.reason, at)


def engine_failed(state: RunState, event: e.EngineFailed, at: float) -> Changes:
    """What breaks in a search for margins does no harm to the reduction before it."""
    if state.margining is None:
        return _ended(state, "failed", event.reason, at)
    return {**_as_it_was(state, at), "margins": replace(state.margining, broken_off=True)}


def finished(state: RunState, event: e.Finished, at: float) -> Changes:
    size = len(state.environment)
    here = replace(state.nodes[state.node], minimal=event.minimal)
    point = Point(state.tests_done, size, min(size, state.lower_bound))
    # A run that is resumed at its end finishes again.
    history = state.history if state.history[-1] == point else (*state.history, point)
    more = {"minimal": event.minimal, "nodes": with_node(state.nodes, here), "history": history}
    return _ended(state, "finished", event.reason, at) | more


def paused(state: RunState, _: e.Paused, __: float) -> Changes:
    return {"paused": True, "status": state.status if state.status == "waiting" else "paused"}


def resumed(state: RunState, _: e.Resumed, __: float) -> Changes:
    working = "baseline" if state.baseline is None else "running"
    return {"paused": False, "status": working if state.status == "paused" else state.status}


def _stopped(state: RunState, at: float) -> Changes:
    """No engine works from Unix time `at` on, s."""
    return {"working_seconds": spent(state, at), "started_at": None}


def clock_jumped(state: RunState, event: e.ClockJumped, at: float) -> Changes:
    """Nobody worked in that time."""
    if state.started_at is None:
        return {}
    return {"started_at": min(at, state.started_at + event.seconds)}


def _stands(state: RunState) -> bool:
    return state.paused or state.needs_room > 0 or state.waiting_candidate is not None


# The world.


def supports(state: RunState, event: e.Supports, _: float) -> Changes:
    def named(pairs: Iterable[e.Pair]) -> tuple[tuple[str, str], ...]:
        return tuple((state.elements[first], state.elements[second]) for first, second in pairs)

    ties = None if event.ties is None else named(event.ties)
    return {"settling": False, "unsettled": event.why, "supports": named(event.pairs), "ties": ties}


def environment_named(state: RunState, event: e.EnvironmentNamed, _: float) -> Changes:
    if event.environment != len(state.environments) or not event.models <= state.environments[0]:
        raise ValueError(event.environment)
    return {"environments": state.environments.added(event.models)}


# The search.


def round_started(state: RunState, event: e.RoundStarted, _: float) -> Changes:
    whole = state.environments[event.environment]
    # The bits of a model that is not there could fill the memory.
    if max((model for part in event.partitions for model in part), default=0) >= len(
        state.elements
    ):
        raise ValueError("partitions")
    parts = tuple(map(Environment.of, event.partitions))
    together = event.pinned
    for part in parts:
        together |= part
    if (
        len(together) != sum(map(len, event.partitions)) + len(event.pinned)
        or not together <= whole
        or not all(parts)
    ):
        raise ValueError("partitions")
    asked = {(kind, partition) for kind, partition, _ in event.candidates}
    if len(asked) != len(event.candidates) or any(
        partition >= len(parts) for _, partition in asked
    ):
        raise ValueError("candidates")
    if state.round is not None and event.round <= state.round.number:
        raise ValueError(event.round)
    # Each part's letter is that which it had in the split before, or else the first that is free.
    before = None if state.round is None else state.round.split
    had = {} if before is None else dict(zip(before.parts, before.letters, strict=True))
    kept = {had[part] for part in parts if part in had}
    free = (number for number in itertools.count() if number not in kept)
    letters = tuple(had[part] if part in had else next(free) for part in parts)
    names = tuple(tuple(map(state.elements.__getitem__, part)) for part in event.partitions)
    always = event.pinned.names(state.elements)
    split = Split(
        environment=whole.names(state.elements),
        partitions=names,
        pinned=always,
        whole=whole,
        parts=parts,
        always=event.pinned,
        letters=letters,
    )
    candidates = PersistentTuple.of(
        Candidate(index=index, kind=kind, partition=partition, split=split, distance=distance)
        for index, (kind, partition, distance) in enumerate(event.candidates)
    )
    here = replace(state.nodes[state.node], n_partitions=event.n_partitions)
    round = Round(
        number=event.round, n_partitions=event.n_partitions, split=split, candidates=candidates
    )
    return {**waits_no_more(state), "round": round, "nodes": with_node(state.nodes, here)}


def forecast(state: RunState, event: e.Forecast, _: float) -> Changes:
    """A search is foretold anew in each round: each forecast narrows the one before, unless they
    contradict each other.
    """
    if list(event.tests) != sorted(event.tests):
        raise ValueError(event.tests)
    low, likely, high = event.tests
    if state.forecast is not None:
        done = event.tests_done - state.forecast.tests_done
        low = max(low, state.forecast.tests[0] - done)
        high = min(high, state.forecast.tests[2] - done)
    return {
        "forecast": event
        if low > high
        else replace(event, tests=(low, min(max(low, likely), high), high))
    }


def candidate_judged(state: RunState, event: e.CandidateJudged, _: float) -> Changes:
    candidate = replace(tried(state, event), verdict=event.verdict, tests=event.tests)
    changes = with_candidate(state, candidate)
    changes["left_unknown"] = state.left_unknown or event.verdict == "unknown"
    # Without tests it is part of what has lost the rate.
    if event.verdict != "dissimilar" or not event.tests:
        return changes
    # Something in the part that it leaves out is needed, and these parts are disjoint.
    round: Round = changes["round"]
    round = replace(
        round, missed=round.missed + (candidate.kind == "complement" or len(round.partitions) == 2)
    )
    changes["round"] = round
    needed = min(max(state.lower_bound, round.missed, 1), len(round.environment))
    if needed != state.lower_bound:
        point = Point(state.tests_done, len(state.environment), needed)
        changes |= {"lower_bound": needed, "history": (*state.history, point)}
    return changes


def waiting(state: RunState, event: e.Waiting, _: float) -> Changes:
    return {"status": "waiting", "waiting_candidate": tried(state, event).index}


def decided(state: RunState, event: e.Decided, at: float) -> Changes:
    candidate = tried(state, event)
    accepts = event.decision == "accept"
    words = f"{'accepted' if accepts else 'rejected'} {_described(state, candidate)}"
    status = "paused" if state.paused else "running"
    changes = {
        "status": status,
        "waiting_candidate": None,
        **decision(state, at, event.decision, words),
    }
    if accepts:
        return changes | {"round": replace(current(state), accepted=candidate.index)}
    rejected = replace(candidate, verdict="rejected")
    return {
        **changes,
        **with_candidate(state, rejected),
        **refused(state, candidate.kept, "rejected", event.round),
    }


def reduced(state: RunState, event: e.Reduced, at: float) -> Changes:
    winner = tried(state, event)
    round = current(state)
    # One part alone shows f although several seemed to be needed: the lower bound was wrong.
    if winner.kind == "partition" and round.missed > 1:
        state = state.changed(lower_bound=0)
    changes = arrived(
        state, event.environment, event.evidence_test, at, "reduced", winner.label, winner.tests
    )
    return changes | {"round": replace(round, winner=winner.index)}


def round_finished(state: RunState, event: e.RoundFinished, _: float) -> Changes:
    round = current(state)
    changes: Changes = {"round": replace(round, done=True), "rounds_done": round.number}
    if state.search is not None:
        last = len(round.candidates)
        evidence = None
        if round.winner is not None:
            last = round.winner + 1
            evidence = state.evidence_test
        judged = [one for one in round.candidates[:last] if one.verdict in JUDGED]
        tests = tuple(dict.fromkeys(test for one in judged for test in one.tests))
        unknown = tuple(one.index for one in judged if one.verdict == "unknown")
        past = PastRound(
            digest=digest(round.split.parts),
            winner=round.winner,
            evidence_test=evidence,
            tests=tests,
            unknown=unknown,
        )
        changes["search"] = replace(state.search, past=(*state.search.past, past))
    return changes


def digest(parts: Iterable[Environment]) -> int:
    """A number that tells the partitions of a round from others."""
    return hash(tuple(part.bits for part in parts))


def accept_mode_changed(state: RunState, event: e.AcceptModeChanged, at: float) -> Changes:
    if event.mode == state.accept_mode:
        return {}
    if event.mode == "ask":
        words = "reductions wait for accept or reject"
    else:
        words = "reductions are accepted automatically"
    return {"accept_mode": event.mode, **decision(state, at, "accept_mode", words)}


def vetoed(state: RunState, event: e.Vetoed, at: float) -> Changes:
    candidate = replace(tried(state, event), verdict=event.verdict)
    changes = {
        **with_candidate(state, candidate),
        **refused(state, candidate.kept, event.verdict, event.round),
    }
    if event.again:
        return changes
    return changes | decision(state, at, "veto", f"vetoed {_described(state, candidate)}")


def unvetoed(state: RunState, event: e.Unvetoed, at: float) -> Changes:
    candidate = tried(state, event)
    round = current(state)
    known = next((one for one in state.refused if one.environment == candidate.kept), None)
    changes = {
        **with_candidate(state, replace(candidate, verdict="")),
        **decision(state, at, "unveto", f"allowed {_described(state, candidate)} again"),
        "refused": tuple(one for one in state.refused if one is not known),
        "refusals": state.refusals + 1,
        # A refusal in an earlier round has blocked candidates since, so the search starts again.
        "search_due": state.search_due or known is None or known.round != event.round,
    }
    if round.accepted == candidate.index:
        changes["round"] = replace(changes["round"], accepted=None)
    # The first similar candidate wins: a later one must wait for the verdict of this one.
    if state.waiting_candidate is not None and state.waiting_candidate > candidate.index:
        changes |= waits_no_more(state)
    return changes


def _described(state: RunState, candidate: Candidate) -> str:
    return f"{candidate.label} of round {current(state).number} ({count(candidate.size, 'model')})"


# By its name in a file each event has a function, here or in a file beside this one, or stands
# below. Each returns only the changed fields, so that the state is copied once per event.
_HANDLERS: dict[type[e.Event], Callable[[RunState, Any, float], Changes]] = {
    e.KINDS[name]: function
    for place in (globals(), *map(vars, (fold_tests, fold_decisions, fold_claims)))
    for name, function in place.items()
    if name in e.KINDS
} | {
    e.Cluster: lambda _, event, __: {"jobs": event.jobs, "cluster": event.words},
    e.Comparing: lambda *_: {},
    e.DiskSpace: lambda _, event, __: {
        "needs_room": 0 if event.enough else event.needed,
        "file_is_full": event.in_file,
    },
    e.SupportsStarted: lambda *_: {"settling": True},
    e.Still: lambda *_: {"ties": ()},
    e.Noted: lambda state, event, _: {"notes": (*state.notes, (event.about, event.words))},
    e.IsolationFinished: lambda state, event, at: (
        fold_claims.isolation_found(state, event) | _as_it_was(state, at)
    ),
    e.IsolationGivenUp: lambda state, _, at: (
        _as_it_was(state, at) | {"isolations": fold_decisions.without_open(state)}
    ),
    e.MarginImpossible: fold_claims.margin_ran,
    e.MarginsFinished: lambda state, _, at: (
        _as_it_was(state, at) | {"margins": replace(fold_claims.open_margins(state), ended=True)}
    ),
    e.CommandRefused: lambda *_: {},
    e.CommandHandled: lambda *_: {},
}


def _as_it_was(state: RunState, at: float) -> Changes:
    """After an isolation, or a search for margins, the reduction is as it was before."""
    if state.isolating is None:
        margins = fold_claims.open_margins(state)
        return _ended(state, margins.asked.status, margins.asked.before, at)
    return _ended(state, "finished", state.isolating.asked.before, at)
