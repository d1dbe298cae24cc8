"""Partitions by when the robot was near."""

from __future__ import annotations

import numpy as np

from ddenv.reduction.evidence import Evidence, Partition
from ddenv.reduction.partitionings.grouped import grouped


def timeseg(environment: Partition, n_partitions: int, evidence: Evidence) -> list[Partition]:
    """The trajectory of the last similar run is cut into n spans of equal duration; a model belongs to the span whose path is
    nearest to it. A robot that is stuck for long has many spans at one place, so that the models there come apart from the rest
    early. Good when it matters when the robot met a model.
    """
    times = evidence.need("trajectory")[:, 0]
    return by_span(environment, np.linspace(times[0], times[-1], n_partitions + 1)[1:-1], evidence)


def by_span(environment: Partition, cuts: np.ndarray, evidence: Evidence) -> list[Partition]:
    """The models by the span of time, between sorted `cuts` (s), in which the robot was nearest to them."""
    return grouped(environment, np.searchsorted(cuts, evidence.nearest(environment)[:, 1], side="left"))
