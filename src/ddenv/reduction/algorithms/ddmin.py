"""Delta debugging as it was for programs (Zeller and Hildebrandt 2002, "Simplifying and Isolating Failure-Inducing Input")."""

from __future__ import annotations

from ddenv.reduction.evidence import Partition
from ddenv.reduction.guide import Guide, Search
from ddenv.reduction.round import Round, round_of


def ddmin(elements: Partition, guide: Guide) -> Search:
    """Classic delta debugging. The environment is cut into n runs of models in the order of the world file; first each run is tried
    alone, then each complement. A run that shows the failure is split in two next, a complement is kept in its n - 1 runs, and
    when nothing shows, n doubles. It uses neither positions nor the failure's place: what space and time are worth is the
    difference to it.

    Tests that were made before are not made again, as the paper has it. A last model is left out, too.
    """
    environment, partitions = elements, _cut(elements, 2)
    while environment:
        winner = yield _round(environment, partitions)
        if winner is None:
            if len(partitions) == len(environment):
                break
            partitions = _cut(environment, 2 * len(partitions))
        elif winner.kind == "partition":
            environment = winner.part
            partitions = _cut(environment, 2)
        else:
            partitions = partitions[: winner.partition] + partitions[winner.partition + 1 :]
            environment = tuple(name for partition in partitions for name in partition)
            # With one partition left it would be its own environment.
            partitions = partitions if len(partitions) > 1 else _cut(environment, 2)
    return frozenset(environment)


def _cut(environment: Partition, n: int) -> list[Partition]:
    """Up to n runs of neighbours, as equal in length as can be."""
    size, n = len(environment), min(n, len(environment))
    return [environment[size * part // n : size * (part + 1) // n] for part in range(n)]


def _round(environment: Partition, partitions: list[Partition]) -> Round:
    """Subsets first, then complements."""
    n = len(partitions)
    ranked = [(partition, float(place)) for place, partition in enumerate(partitions)]
    wanted = [(kind, place) for kind in ("partition", "complement") for place in range(n)]
    return round_of(n, environment, ranked, wanted)
