"""In any order."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ddenv.reduction.evidence import Evidence, Partition


def random(partitions: Sequence[Partition], evidence: Evidence) -> list[float]:
    """Partitions are tried in a random order, which the seed and the round fix: the same run shuffles in the same way. What any
    other prioritization has to beat.

    The scores mean nothing.
    """
    models = sum(len(partition) for partition in partitions)
    return np.random.default_rng([evidence.seed, models, len(partitions)]).random(len(partitions)).tolist()
