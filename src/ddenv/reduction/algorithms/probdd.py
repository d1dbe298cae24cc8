"""Probabilistic delta debugging (Wang, Shen, Chen, Xiong, Zhang 2021)."""

from __future__ import annotations

import numpy as np

from ddenv.reduction.algorithms.sweep import sweep
from ddenv.reduction.evidence import Partition
from ddenv.reduction.guide import Guide, Search
from ddenv.reduction.round import left_out


def probdd(elements: Partition, guide: Guide) -> Search:
    """Probabilistic delta debugging. Each model has a chance of being needed, at first by how near it is to the failure (or the
    same for all, with the scenario's key `reduction.prior: uniform`). Each test leaves out the models whose loss would be the
    greatest gain on average; if the failure does not show, the chances of those that were left out rise. When all that is left is
    certain, each model is left out once more.
    """
    chance = dict(zip(elements, guide.chances(elements).tolist(), strict=True))
    environment = elements
    while group := _best_group(environment, chance):
        round = left_out(group, environment)
        # f is taken to need something: leaving out everything is not worth a test.
        winner = (yield round) if round.candidates else None
        if winner is None:
            _raise_chances(group, chance)
        else:
            environment = tuple(name for name in environment if name not in set(group))
    return (yield from sweep(tuple(sorted(environment, key=chance.__getitem__))))


def _best_group(environment: Partition, chance: dict[str, float]) -> Partition:
    """The least likely models, so many that their number times the chance that none is needed is greatest; certain ones never."""
    order = [name for name in sorted(environment, key=chance.__getitem__) if chance[name] < 1.0]
    if not order:
        return ()
    none_needed = np.cumprod([1.0 - chance[name] for name in order])
    return tuple(order[: 1 + int(np.argmax(none_needed * np.arange(1, len(order) + 1)))])


def _raise_chances(group: Partition, chance: dict[str, float]) -> None:
    """Bayes' rule: one of the group is needed at least."""
    some_needed = 1.0 - np.prod([1.0 - chance[name] for name in group])
    for name in group:
        chance[name] = 1.0 if len(group) == 1 else min(1.0, chance[name] / float(some_needed))
