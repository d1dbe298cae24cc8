"""The end of algorithms that guess: each model that is left is left out once more."""

from __future__ import annotations

from ddenv.reduction.evidence import Partition
from ddenv.reduction.guide import Search
from ddenv.reduction.round import one_model_partitions, round_of


def sweep(environment: Partition) -> Search:
    """Rounds in which each model is left out in turn, in the environment's order, until none can be: returns what is left.

    After a success the next model is the first in line, since those before it were just needed; they are tried again at the end.
    """
    while environment:
        ranked = [(part, float(place)) for place, part in enumerate(one_model_partitions(environment))]
        round = round_of(len(environment), environment, ranked, [("complement", place) for place in range(len(ranked))])
        winner = yield round
        if winner is None:
            break
        place = winner.partition
        environment = environment[place + 1 :] + environment[:place]
    return frozenset(environment)
