"""Stacks: models that rest on each other, as one element of a search. The algorithm gets one model of each; its rounds are
expanded, so that whatever is tested has all of a stack or nothing of it.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

from ddenv.environment import NOTHING, Environment
from ddenv.reduction.guide import Search
from ddenv.reduction.round import Candidate, Partition, Round


@dataclass(frozen=True)
class Stacks:
    """The stacks of an environment by their first models, which stand for them, in the order of the world."""

    by_first: dict[int, Environment]

    @classmethod
    def of(cls, groups: Iterable[Environment]) -> Stacks:
        """`groups` are disjoint and not empty, as of `ddenv.runfile.supports.stacks`."""
        return cls({next(iter(group)): group for group in groups})

    @property
    def representatives(self) -> Partition:
        """The first model of each stack."""
        return tuple(self.by_first)

    def expanded(self, representatives: Iterable[int]) -> Partition:
        """All models of the stacks for which `representatives` stand, one stack after the other."""
        return tuple(model for first in representatives for model in self.by_first[first])

    def of_any(self, models: Environment) -> Environment:
        """All models of the stacks of which any model is among `models`."""
        whole = NOTHING
        for stack in self.by_first.values():
            if not stack.isdisjoint(models):
                whole |= stack
        return whole

    def expand(self, search: Search) -> Search:
        """`search`, which knows only the representatives, as a search that tests whole stacks."""
        if all(len(stack) == 1 for stack in self.by_first.values()):
            return (yield from search)
        winner: Candidate | None = None
        while True:
            try:
                round = search.send(winner)
            except StopIteration as end:
                return Environment.of(self.expanded(end.value))
            whole = self._expanded(round)
            won = yield whole
            winner = None if won is None else round.candidates[whole.candidates.index(won)]

    def _expanded(self, round: Round) -> Round:
        def stacks(models: Iterable[int]) -> Environment:
            return Environment.of(self.expanded(models))

        candidates = (
            replace(one, part=self.expanded(one.part), models=stacks(one.models), lacks=stacks(one.lacks))
            for one in round.candidates
        )
        partitions = tuple(map(self.expanded, round.partitions))
        environment = self.expanded(round.environment)
        return replace(round, environment=environment, partitions=partitions, candidates=tuple(candidates))
