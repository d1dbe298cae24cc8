"""A round: the environment's partitions in the order in which they are tried, and the candidates made from them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from ddenv.reduction.evidence import Partition

CANDIDATES = ("both", "partitions", "complements")
COMPLEMENT_ORDERS = ("paper", "far-first")


@dataclass(frozen=True)
class Candidate:
    """A sub-environment to try: `kind` is "partition" or "complement" of the round's partition number `partition`.

    `part` is that partition. `models` is computed each time: stored, the models of 5,000 complements would take gigabytes.
    """

    kind: str
    partition: int
    part: Partition
    environment: Partition

    @property
    def models(self) -> frozenset[str]:
        """The models that are there."""
        part = frozenset(self.part)
        return part if self.kind == "partition" else frozenset(self.environment) - part

    @property
    def lacks(self) -> frozenset[str]:
        """The models of the environment that are not there."""
        part = frozenset(self.part)
        return part if self.kind == "complement" else frozenset(self.environment) - part

    @property
    def size(self) -> int:
        """The number of models that are there."""
        return len(self.part) if self.kind == "partition" else len(self.environment) - len(self.part)


@dataclass(frozen=True)
class Round:
    """`partitions` in the order in which they are tried, with the `scores` that rank them. The first similar candidate wins.

    `runs` is how many runs a candidate has if none shows f, where the algorithm wants no more for now; None is as many as usual.
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


def one_model_partitions(environment: Partition) -> list[Partition]:
    """Each model as a partition of its own."""
    return [(name,) for name in environment]


def make_round(
    n_partitions: int,
    environment: Partition,
    ranked: Sequence[tuple[Partition, float]],
    candidates: str = "both",
    complement_order: str = "paper",
) -> Round:
    """A round with the candidates p0, c0, p1, c1, ... of the ranked partitions, without E itself and without repetitions.

    With `complement_order` "far-first" the complements come in the opposite order: the farthest partition is left out first.
    """
    count = len(ranked)
    order = range(count) if complement_order == "paper" else range(count - 1, -1, -1)
    pairs = ((("partition", near), ("complement", far)) for near, far in zip(range(count), order, strict=True))
    wanted = [one for pair in pairs for one in pair if candidates in ("both", f"{one[0]}s")]
    return round_of(n_partitions, environment, ranked, wanted)


def round_of(
    n_partitions: int,
    environment: Partition,
    ranked: Sequence[tuple[Partition, float]],
    wanted: Iterable[tuple[str, int]],
) -> Round:
    """A round with the candidates `wanted`, given as (kind, partition), without E itself and without repetitions.

    The empty set is a candidate only if E is a single model.
    """
    partitions, scores = zip(*ranked, strict=True)
    whole = len(environment)
    found = []
    seen: set[tuple[str, int]] = set()
    for kind, number in wanted:
        one = Candidate(kind, number, partitions[number], environment)
        # Two partitions are each other's complements; otherwise all candidates differ.
        same = ("partition", 1 - number) if kind == "complement" else ("complement", 1 - number)
        repeated = (kind, number) in seen or (len(partitions) == 2 and same in seen)
        if repeated or one.size == whole or (one.size == 0 and whole > 1):
            continue
        seen.add((kind, number))
        found.append(one)
    return Round(n_partitions, environment, tuple(partitions), tuple(scores), tuple(found))


def left_out(group: Partition, environment: Partition, score: float = 0.0) -> Round:
    """A round with one candidate, E without `group`. The group is the first partition, the rest the second."""
    gone = frozenset(group)
    rest = tuple(name for name in environment if name not in gone)
    ranked = [(group, score), (rest, score)] if rest else [(group, score)]
    return round_of(len(ranked), environment, ranked, [("complement", 0)])
