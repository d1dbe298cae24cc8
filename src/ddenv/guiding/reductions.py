"""Candidates of the round: accept or reject the reduction that waits, veto a candidate, take a veto back."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ddenv.amounts import count
from ddenv.guiding.situation import ROUND_OVER, Situation, Words, next_candidate
from ddenv.runfile.state import REFUSED, Candidate, RunState


@dataclass(frozen=True, slots=True)
class Accept:
    """Make the reduction that waits."""

    kind: ClassVar[str] = "accept"
    offer: ClassVar[str] = "accept"
    round: int
    candidate: int

    def refusal(self, now: Situation) -> str:
        return _not_waiting(now, self)

    def words(self, state: RunState) -> Words:
        one = _candidate(state, self)
        left = "" if one is None else f": E is now its {count(one.size, 'model')}. The next round begins"
        return Words("accept", f"{_label(state, self)} is accepted{left}")


@dataclass(frozen=True, slots=True)
class Reject:
    """Go on as if the candidate that waits had not shown f."""

    kind: ClassVar[str] = "reject"
    offer: ClassVar[str] = "reject"
    round: int
    candidate: int

    def refusal(self, now: Situation) -> str:
        return _not_waiting(now, self)

    def words(self, state: RunState) -> Words:
        return Words("reject", f"{_label(state, self)} is rejected. {next_candidate(state, self.candidate)}")


@dataclass(frozen=True, slots=True)
class Veto:
    """Leave out a candidate that has no verdict yet."""

    kind: ClassVar[str] = "veto"
    offer: ClassVar[str] = "veto"
    round: int
    candidate: int

    def refusal(self, now: Situation) -> str:
        one = _candidate(now.state, self)
        if one is None:
            return round_over(now.state)
        if one.index == now.state.waiting_candidate:
            return f"{one.label} showed f and waits: reject it with x"
        return f"{one.label} is {one.verdict} already" if one.verdict else ""

    def words(self, state: RunState) -> Words:
        said = f"{_label(state, self)} is vetoed: it is not tried in any round; v again takes that back"
        return Words("veto", f"{said}. {next_candidate(state, self.candidate)}")


@dataclass(frozen=True, slots=True)
class Unveto:
    """Try a vetoed or rejected candidate after all."""

    kind: ClassVar[str] = "unveto"
    offer: ClassVar[str] = "take back"
    round: int
    candidate: int

    def refusal(self, now: Situation) -> str:
        one = _candidate(now.state, self)
        if one is None:
            return round_over(now.state)
        return "" if one.verdict in REFUSED else f"{one.label} is neither vetoed, rejected nor undone"

    def words(self, state: RunState) -> Words:
        one = _candidate(state, self)
        verdict = "vetoed" if one is None else one.verdict
        return Words("allow it again", f"{_label(state, self)} is no longer {verdict}: it is tried after all")


def round_over(state: RunState) -> str:
    """Why candidates can no longer be left out."""
    return "the rounds are over" if state.confirming and not state.ended else ROUND_OVER


_Of = Accept | Reject | Veto | Unveto


def _candidate(state: RunState, command: _Of) -> Candidate | None:
    """The command's candidate, while its round goes on."""
    current = state.round
    if current is None or current.done or current.winner is not None or current.number != command.round:
        return None
    return current.candidates[command.candidate] if 0 <= command.candidate < len(current.candidates) else None


def _label(state: RunState, command: _Of) -> str:
    one = _candidate(state, command)
    return "the candidate" if one is None else one.label


def _not_waiting(now: Situation, command: Accept | Reject) -> str:
    state = now.state
    waits = None
    # When a new search is due, earlier reductions can no longer be accepted.
    if state.round is not None and state.waiting_candidate is not None and not now.search_due:
        waits = state.round.number, state.waiting_candidate
    same = (command.round, command.candidate) == waits
    return "" if same else "that reduction no longer waits"
