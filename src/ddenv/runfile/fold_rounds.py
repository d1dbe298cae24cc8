"""What the events of rounds change in a run's state: candidates are announced, judged, refused and taken."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ddenv.runfile.persistent import PersistentTuple
from ddenv.runfile.state import Candidate, Point, Round, RunState, Split
from ddenv.runfile.values import Changes, Data, names, number


def round_started(state: RunState, data: Data, _: float) -> Changes:
    environment = names(state.elements, data["environment"])
    partitions = tuple(names(state.elements, part) for part in data["partitions"])
    split = Split(environment, partitions)
    _check(split, data["candidates"])
    candidates = PersistentTuple.of(
        Candidate(index, kind, partition, split, None if distance is None else number(distance))
        for index, (kind, partition, distance) in enumerate(data["candidates"])
    )
    return {"round": Round(int(data["round"]), int(data["n_partitions"]), split, candidates)}


def _check(split: Split, candidates: list[Any]) -> None:
    """Partitions are disjoint and within the environment, and each makes at most two candidates: there are not many."""
    models = [name for partition in split.partitions for name in partition]
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


def candidate_judged(state: RunState, data: Data, _: float) -> Changes:
    candidate = tried(state, data["candidate"])
    tests, known = tuple(map(int, data["tests"])), int(data["known"])
    return with_candidate(state, replace(candidate, verdict=str(data["verdict"]), tests=tests, known=known))


def vetoed(state: RunState, data: Data, _: float) -> Changes:
    return with_candidate(state, replace(tried(state, data["candidate"]), verdict=str(data["verdict"])))


def waiting(state: RunState, data: Data, _: float) -> Changes:
    return {"status": "waiting", "waiting_candidate": tried(state, data["candidate"]).index}


def decided(state: RunState, data: Data, _: float) -> Changes:
    changes = {"status": "paused" if state.paused else "running", "waiting_candidate": None}
    if data["decision"] == "accept":
        return changes
    return changes | with_candidate(state, replace(tried(state, data["candidate"]), verdict="rejected"))


def reduced(state: RunState, data: Data, _: float) -> Changes:
    environment = names(state.elements, data["environment"])
    return {
        "environment": environment,
        "round": replace(state.round, winner=tried(state, data["candidate"]).index),
        "history": (*state.history, Point(state.tests_done, len(environment))),
        "evidence_test": int(data["evidence_test"]),
    }


def round_finished(state: RunState, _: Data, __: float) -> Changes:
    return {"round": replace(state.round, done=True), "rounds_done": state.round.number}


def tried(state: RunState, index: int) -> Candidate:
    """A candidate of the current round. Raises IndexError if there is none with this index."""
    if index < 0:
        raise IndexError(index)
    return state.round.candidates[index]


def with_candidate(state: RunState, candidate: Candidate) -> Changes:
    """The round with another candidate in the place of the one with the same index."""
    candidates = state.round.candidates.changed(candidate.index, candidate)
    return {"round": replace(state.round, candidates=candidates)}
