"""The ddenv algorithm (paper, Algorithm 1) as a generator: it yields rounds, is sent each round's winner, and runs nothing."""

from __future__ import annotations

from collections.abc import Callable, Generator, Iterable

from ddenv.reduction.evidence import Partition
from ddenv.reduction.partitioning import one_model_partitions
from ddenv.reduction.round import Candidate, Round, make_round

Split = Callable[[Partition, int], list[Partition]]
Rank = Callable[[list[Partition]], list[float]]


def ddenv(
    elements: Iterable[str],
    split: Split,
    rank: Rank,
    n_partitions: int = 2,
    *,
    candidates: str = "both",
    complement_order: str = "paper",
) -> Generator[Round, Candidate | None, frozenset[str]]:
    """Yields `Round`s; send it the first similar candidate, or None; returns the environment that is left.

    `split(environment, n)` partitions, `rank(partitions)` scores them (lowest first). The granularity n grows by one after
    every round and is at most |E|. It ends when a round of one-model partitions showed nothing similar. (Algorithm 1 as
    printed counts up before it checks, and would end one granularity early.) A last model is left out, too: whether f needs
    it is not known before.
    """
    environment = tuple(elements)
    n = n_partitions
    while environment:
        n = min(n, len(environment))
        partitions = one_model_partitions(environment) if n == len(environment) else split(environment, n)
        ranked = sorted(zip(partitions, rank(partitions), strict=True), key=lambda pair: pair[1])
        round = make_round(n, environment, ranked, candidates, complement_order)
        if not round.candidates and round.exhaustive:
            break
        winner = yield round
        if winner is not None:
            environment = tuple(name for name in environment if name in winner.models)
        elif round.exhaustive:
            break
        n += 1
    return frozenset(environment)
