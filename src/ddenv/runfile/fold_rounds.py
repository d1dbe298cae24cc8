"""What the events of rounds change in a run's state: candidates are announced, judged, refused and taken."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ddenv.runfile.fold_nodes import arrived, decision, waits_no_more
from ddenv.runfile.guiding import many
from ddenv.runfile.persistent import PersistentTuple
from ddenv.runfile.state import Candidate, Point, Round, RunState, Split
from ddenv.runfile.values import Changes, Data, names, number, one_of


def round_started(state: RunState, data: Data, _: float) -> Changes:
    environment = names(state.elements, data["environment"])
    partitions = tuple(names(state.elements, part) for part in data["partitions"])
    split = Split(environment, partitions, names(state.elements, data.get("pinned", ())))
    _check(split, data["candidates"])
    if state.round is not None and int(data["round"]) <= state.round.number:
        raise ValueError(data["round"])
    candidates = PersistentTuple.of(
        Candidate(index, kind, partition, split, None if distance is None else number(distance))
        for index, (kind, partition, distance) in enumerate(data["candidates"])
    )
    round = Round(int(data["round"]), int(data["n_partitions"]), split, candidates)
    return {**waits_no_more(state), "round": round}


def _check(split: Split, candidates: list[Any]) -> None:
    """Partitions are disjoint and within the environment, and each makes at most two candidates: there are not many."""
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


def candidate_judged(state: RunState, data: Data, _: float) -> Changes:
    candidate = replace(
        tried(state, data["candidate"]),
        verdict=one_of(data["verdict"], "similar", "dissimilar"),
        tests=tuple(map(int, data["tests"])),
        known=int(data["known"]),
    )
    round = with_candidate(state, candidate)["round"]
    if candidate.verdict != "dissimilar":
        return {"round": round}
    # What it leaves out is needed in part; what different complements leave out has nothing in common.
    apart = candidate.kind == "complement" or len(round.partitions) == 2
    round = replace(round, missed=round.missed + apart)
    needed = min(max(state.lower_bound, round.missed, 1), len(round.environment))
    if needed == state.lower_bound:
        return {"round": round}
    point = Point(state.tests_done, len(state.environment), needed)
    return {"round": round, "lower_bound": needed, "history": (*state.history, point)}


def vetoed(state: RunState, data: Data, at: float) -> Changes:
    verdict = one_of(data["verdict"], "vetoed", "rejected")
    candidate = replace(tried(state, data["candidate"]), verdict=verdict)
    changes = with_candidate(state, candidate)
    if data.get("again"):
        return changes
    return changes | decision(state, at, "veto", f"vetoed {_told(state, candidate)}")


def unvetoed(state: RunState, data: Data, at: float) -> Changes:
    candidate = tried(state, data["candidate"])
    words = f"took back the veto of {_told(state, candidate)}"
    if candidate.verdict == "rejected":
        words = f"took back the rejection of {_told(state, candidate)}"
    changes = with_candidate(state, replace(candidate, verdict="")) | decision(state, at, "unveto", words)
    # The first similar one wins: what waits behind this one has to wait for its verdict.
    if state.waiting_candidate is not None and state.waiting_candidate > candidate.index:
        changes |= waits_no_more(state)
    return changes


def waiting(state: RunState, data: Data, _: float) -> Changes:
    return {"status": "waiting", "waiting_candidate": tried(state, data["candidate"]).index}


def decided(state: RunState, data: Data, at: float) -> Changes:
    changes = {"status": "paused" if state.paused else "running", "waiting_candidate": None}
    candidate = tried(state, data["candidate"])
    said = f"{'accepted' if data['decision'] == 'accept' else 'rejected'} {_told(state, candidate)}"
    changes |= decision(state, at, str(data["decision"]), said)
    if data["decision"] == "accept":
        return changes
    return changes | with_candidate(state, replace(candidate, verdict="rejected"))


def reduced(state: RunState, data: Data, at: float) -> Changes:
    winner = tried(state, data["candidate"])
    # One part alone shows f, and yet others seemed to be needed: what was known is not so.
    if winner.kind == "partition" and state.round.missed > 1:
        state = state.changed(lower_bound=0)
    changes = arrived(state, data, at, "reduced", winner.label)
    return changes | {"round": replace(state.round, winner=winner.index)}


def _told(state: RunState, candidate: Candidate) -> str:
    return f"{candidate.label} of round {state.round.number} ({many(candidate.size)})"


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
