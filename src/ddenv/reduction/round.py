"""A round: the environment's partitions in the order they are tried, and the candidates that come of them."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from ddenv.reduction.evidence import Partition

CANDIDATES = ("both", "partitions", "complements")
COMPLEMENT_ORDERS = ("paper", "far-first")


@dataclass(frozen=True)
class Candidate:
    """A sub-environment to try: `kind` is "partition" or "complement" of the round's partition number `partition`.

    `part` is that partition. The models are not kept: of 5,000 complements they would take gigabytes.
    """

    kind: str
    partition: int
    part: Partition
    environment: Partition

    @property
    def models(self) -> frozenset[str]:
        """What is there."""
        part = frozenset(self.part)
        return part if self.kind == "partition" else frozenset(self.environment) - part

    @property
    def lacks(self) -> frozenset[str]:
        """What of the environment is not there."""
        part = frozenset(self.part)
        return part if self.kind == "complement" else frozenset(self.environment) - part

    @property
    def size(self) -> int:
        """How many models are there."""
        return len(self.part) if self.kind == "partition" else len(self.environment) - len(self.part)


@dataclass(frozen=True)
class Round:
    """`partitions` are in the order they are tried, `scores` what they were ranked by; the first similar candidate wins."""

    n_partitions: int
    environment: Partition
    partitions: tuple[Partition, ...]
    scores: tuple[float, ...]
    candidates: tuple[Candidate, ...]

    @property
    def exhaustive(self) -> bool:
        """Whether every model is a partition of its own: there is nothing finer to try."""
        return len(self.partitions) == len(self.environment)


def one_model_partitions(environment: Partition) -> list[Partition]:
    """Each model on its own."""
    return [(name,) for name in environment]


def make_round(
    n_partitions: int,
    environment: Partition,
    ranked: Sequence[tuple[Partition, float]],
    candidates: str = "both",
    complement_order: str = "paper",
) -> Round:
    """The candidates p0, c0, p1, c1, ... of the ranked partitions, without E itself and repetitions.

    With `complement_order` "far-first" the complements come in the opposite order: what is farthest is left out first.
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
    """The candidates `wanted`, as (kind, partition), without E itself and repetitions.

    Nothing at all is a candidate only where E is a single model.
    """
    partitions, scores = zip(*ranked, strict=True)
    whole = len(environment)
    found = []
    seen: set[tuple[str, int]] = set()
    for kind, number in wanted:
        one = Candidate(kind, number, partitions[number], environment)
        # Of two partitions each is the other's complement; otherwise no candidate is like another.
        same = ("partition", 1 - number) if kind == "complement" else ("complement", 1 - number)
        repeated = (kind, number) in seen or (len(partitions) == 2 and same in seen)
        if repeated or one.size == whole or (one.size == 0 and whole > 1):
            continue
        seen.add((kind, number))
        found.append(one)
    return Round(n_partitions, environment, tuple(partitions), tuple(scores), tuple(found))


def left_out(group: Partition, environment: Partition, score: float = 0.0) -> Round:
    """A round with one candidate: E without `group`. The group is its first partition, all the rest its second."""
    gone = frozenset(group)
    rest = tuple(name for name in environment if name not in gone)
    ranked = [(group, score), (rest, score)] if rest else [(group, score)]
    return round_of(len(ranked), environment, ranked, [("complement", 0)])
