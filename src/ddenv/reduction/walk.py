"""The environments that `ddenv.reduce` passes through, one search after another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from ddenv.reduction.acceptance import Acceptance
from ddenv.reduction.calls import Calls
from ddenv.reduction.certificate import Subject
from ddenv.reduction.evidence import Partition
from ddenv.reduction.guide import Search
from ddenv.reduction.round import Candidate, Round
from ddenv.reduction.stepping_back import Refused
from ddenv.reduction.verdict import standing


@dataclass(frozen=True)
class Step:
    """The environment `kept`, in the order of the elements, after `tests` tests."""

    tests: int
    kept: Partition


class Walk:
    """A way from all elements to fewer ones. `chain` leads to the current environment, without detours; `history` has all steps."""

    def __init__(self, names: Partition, calls: Calls, on_round: Callable[[Round], None]) -> None:
        self._names = names
        self._calls = calls
        self._on_round = on_round
        self.chain = [frozenset(names)]
        self.history = [Step(0, names)]
        self.rounds = 0
        self.refused = Refused()

    @property
    def left(self) -> Partition:
        """What is left, in the order of the elements."""
        return self.ordered(self.chain[-1])

    def ordered(self, models: Subject) -> Partition:
        """`models` in the order of the elements."""
        return tuple(name for name in self._names if name in models)

    def take(self, models: Subject) -> None:
        """Goes on to fewer elements."""
        self.chain.append(models)
        self._reached()

    def back_to(self, place: int) -> None:
        """Goes back to this place of the chain; nothing that lost the rate there is taken again."""
        self.refused.lose(self.chain[place + 1])
        del self.chain[place + 1 :]
        self._reached()

    def search(self, searching: Search, rule: Acceptance, planned: Round | None = None) -> None:
        """Takes what the search finds, to its end. `planned` is its first round, if it began already."""
        round = planned or next_round(searching, None)
        while round is not None:
            self.rounds += 1
            self._on_round(round)
            models = (one.models for one in round.candidates)
            place = standing(models, self._calls.shown, rule.within(round.runs), self.refused).winner
            winner = None if place is None else round.candidates[place]
            if winner is not None:
                self.take(winner.models)
            round = next_round(searching, winner)

    def _reached(self) -> None:
        self.history.append(Step(len(self._calls.trials) + self._calls.others, self.left))


def next_round(searching: Search, winner: Candidate | None) -> Round | None:
    """The next round of a search, or None at its end: then what was taken last is what is left."""
    try:
        return searching.send(winner)
    except StopIteration:
        return None
