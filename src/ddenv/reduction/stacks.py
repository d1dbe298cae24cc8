"""Stacks: models that are connected by what rests on what, as one element of a search.

The algorithm gets one model of each stack, and searches as ever. Its rounds are expanded, so that whatever is tested has all
of a stack or nothing of it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from ddenv.reduction.evidence import Partition
from ddenv.reduction.guide import Search
from ddenv.reduction.round import Candidate, Round


@dataclass(frozen=True)
class Stacks:
    """The stacks of an environment by their first models, which stand for them. All are in the environment's order."""

    by_first: dict[str, Partition]

    @classmethod
    def of(cls, groups: Iterable[Partition]) -> Stacks:
        """`groups` are disjoint and not empty, as of `ddenv.resting.stacks`."""
        return cls({group[0]: group for group in groups})

    @property
    def representatives(self) -> Partition:
        """The first model of each stack."""
        return tuple(self.by_first)

    def expanded(self, representatives: Iterable[str]) -> Partition:
        """All models of the stacks for which `representatives` stand, one stack after the other."""
        return tuple(name for first in representatives for name in self.by_first[first])

    def collapsed(self, models: Iterable[str]) -> Partition:
        """The representatives of the stacks of which all models are among `models`."""
        there = frozenset(models)
        return tuple(first for first, stack in self.by_first.items() if there.issuperset(stack))

    def of_any(self, models: frozenset[str]) -> frozenset[str]:
        """All models of the stacks of which any model is among `models`."""
        return frozenset(name for stack in self.by_first.values() if not models.isdisjoint(stack) for name in stack)

    def expand(self, search: Search) -> Search:
        """`search`, which knows only the representatives, as a search that tests whole stacks."""
        if all(len(stack) == 1 for stack in self.by_first.values()):
            return (yield from search)
        winner: Candidate | None = None
        while True:
            try:
                round = search.send(winner)
            except StopIteration as end:
                return frozenset(self.expanded(end.value))
            whole = self._expanded(round)
            won = yield whole
            winner = None if won is None else round.candidates[whole.candidates.index(won)]

    def _expanded(self, round: Round) -> Round:
        environment = self.expanded(round.environment)
        candidates = tuple(
            Candidate(one.kind, one.partition, self.expanded(one.part), environment) for one in round.candidates
        )
        partitions = tuple(map(self.expanded, round.partitions))
        return replace(round, environment=environment, partitions=partitions, candidates=candidates)
