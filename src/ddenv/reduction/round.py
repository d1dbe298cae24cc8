"""A round: the environment's partitions in the order they are tried, and the candidates that come of them."""

from __future__ import annotations

from dataclasses import dataclass

from ddenv.reduction.evidence import Partition

CANDIDATES = ("both", "partitions", "complements")
COMPLEMENT_ORDERS = ("paper", "far-first")


@dataclass(frozen=True)
class Candidate:
    """A sub-environment to try: `kind` is "partition" or "complement" of the round's partition number `partition`."""

    kind: str
    partition: int
    models: frozenset[str]


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


def make_round(
    n_partitions: int,
    environment: Partition,
    ranked: list[tuple[Partition, float]],
    candidates: str = "both",
    complement_order: str = "paper",
) -> Round:
    """The candidates p0, c0, p1, c1, ... of the ranked partitions, without E itself and repetitions.

    Nothing at all is a candidate only where E is a single model.
    With `complement_order` "far-first" the complements come in the opposite order: what is farthest is left out first.
    """
    count = len(ranked)
    order = range(count) if complement_order == "paper" else range(count - 1, -1, -1)
    found: dict[frozenset[str], Candidate] = {}
    everything = frozenset(environment)
    for near, other in zip(range(count), order, strict=True):
        part, rest = frozenset(ranked[near][0]), everything - frozenset(ranked[other][0])
        if candidates != "complements":
            found.setdefault(part, Candidate("partition", near, part))
        if candidates != "partitions":
            found.setdefault(rest, Candidate("complement", other, rest))
    worth = tuple(one for models, one in found.items() if models != everything and (models or len(everything) == 1))
    partitions, scores = zip(*ranked, strict=True)
    return Round(n_partitions, environment, tuple(partitions), tuple(scores), worth)
