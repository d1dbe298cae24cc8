"""A round: the environment's partitions in the order in which they are tried, and the candidates
made from them. And stacks: models that rest on each other, as one element of a search, so that
whatever is tested has all of a stack or nothing of it.
"""

from __future__ import annotations

from collections.abc import Generator, Iterable, Sequence
from dataclasses import dataclass, replace

from ddenv.environment import NOTHING, Environment

# Models by their numbers, in an order that the algorithm chose.
Partition = tuple[int, ...]


@dataclass(frozen=True, kw_only=True)
class Candidate:
    """A sub-environment to try: "partition" or "complement" of the round's partition number
    `partition`, which is `part`. `models` are there, `lacks` are those of the environment that are
    not.
    """

    kind: str
    partition: int
    part: Partition
    models: Environment
    lacks: Environment


@dataclass(frozen=True, kw_only=True)
class Round:
    """`partitions` in the order in which they are tried, with the `scores` that rank them. The
    first similar candidate wins.

    `runs` is how many runs a candidate has if none shows f, None as many as usual.
    """

    n_partitions: int
    environment: Partition
    partitions: tuple[Partition, ...]
    scores: tuple[float, ...]
    candidates: tuple[Candidate, ...]
    runs: int | None = None

    @property
    def exhaustive(self) -> bool:
        """Whether every model is a partition of its own: there is nothing finer to try."""
        return len(self.partitions) == len(self.environment)


# Yields rounds, is sent the winner of each or None, and returns what is left.
Rounds = Generator[Round, Candidate | None, Environment]


def one_model_partitions(environment: Partition) -> list[Partition]:
    """Each model as a partition of its own."""
    return [(model,) for model in environment]


def make_round(
    n_partitions: int,
    environment: Partition,
    ranked: Sequence[tuple[Partition, float]],
    candidates: str = "both",
    complement_order: str = "paper",
) -> Round:
    """A round with the candidates p0, c0, p1, c1, ... of the ranked partitions, without E itself
    and without repetitions.

    With `complement_order` "far-first" the complements come in the opposite order: the farthest
    partition is left out first.
    """
    count = len(ranked)
    order = range(count) if complement_order == "paper" else range(count - 1, -1, -1)
    pairs = (
        (("partition", near), ("complement", far))
        for near, far in zip(range(count), order, strict=True)
    )
    wanted = [one for pair in pairs for one in pair if candidates in ("both", f"{one[0]}s")]
    return round_of(n_partitions, environment, ranked, wanted)


def round_of(
    n_partitions: int,
    environment: Partition,
    ranked: Sequence[tuple[Partition, float]],
    wanted: Iterable[tuple[str, int]],
) -> Round:
    """A round with the candidates `wanted`, as (kind, partition), without E itself, repetitions,
    and the empty set unless E is a single model.
    """
    partitions, scores = zip(*ranked, strict=True)
    whole = Environment.of(environment)
    parts = [Environment.of(part) for part in partitions]
    candidates: list[Candidate] = []
    seen: set[Environment] = set()
    for kind, number in wanted:
        models = parts[number]
        lacks = whole - parts[number]
        if kind == "complement":
            models, lacks = lacks, models
        if models in seen or not lacks or (not models and len(environment) > 1):
            continue
        seen.add(models)
        candidates.append(
            Candidate(
                kind=kind, partition=number, part=partitions[number], models=models, lacks=lacks
            )
        )
    return Round(
        n_partitions=n_partitions,
        environment=environment,
        partitions=tuple(partitions),
        scores=tuple(scores),
        candidates=tuple(candidates),
    )


def in_order(environment: Partition, partitions: Sequence[Partition], *kinds: str) -> Round:
    """A round with all candidates of each kind in turn, in the order of the partitions."""
    ranked = [(part, float(place)) for place, part in enumerate(partitions)]
    wanted = [(kind, place) for kind in kinds for place in range(len(partitions))]
    return round_of(len(partitions), environment, ranked, wanted)


def left_out(group: Partition, environment: Partition) -> Round:
    """A round with one candidate, E without `group`. The group is the first partition, the rest the
    second.
    """
    gone = frozenset(group)
    rest = tuple(model for model in environment if model not in gone)
    ranked = [(part, 0.0) for part in (group, rest) if part]
    return round_of(len(ranked), environment, ranked, [("complement", 0)])


@dataclass(frozen=True)
class Stacks:
    """The stacks of an environment by their first models, which stand for them, in the order of the
    world.
    """

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

    def expand(self, search: Rounds) -> Rounds:
        """`search`, which knows only the representatives, as a search that tests whole stacks."""
        if all(len(stack) == 1 for stack in self.by_first.values()):
            return (yield from search)
        winner: Candidate | None = None
        while True:
            try:
                round = search.send(winner)
            except StopIteration as end:
                return Environment.of(self.expanded(end.value))
            candidates = []
            for one in round.candidates:
                models, lacks = (
                    Environment.of(self.expanded(part)) for part in (one.models, one.lacks)
                )
                candidates.append(
                    replace(one, part=self.expanded(one.part), models=models, lacks=lacks)
                )
            partitions = tuple(map(self.expanded, round.partitions))
            environment = self.expanded(round.environment)
            won = yield replace(
                round, environment=environment, partitions=partitions, candidates=tuple(candidates)
            )
            winner = None if won is None else round.candidates[candidates.index(won)]
