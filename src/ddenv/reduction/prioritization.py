"""In which order partitions are tried: the prioritization schemas of the paper's Table I.

A schema gives each partition a score; the lowest is tried first, ties stay in the order of the split.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ddenv.reduction.evidence import Evidence, Partition

Prioritization = Callable[[list[Partition], Evidence], list[float]]


def failure_proximal(partitions: list[Partition], evidence: Evidence) -> list[float]:
    """Distance of each partition's centroid to the end of f, m (paper, Algorithm 3)."""
    end = np.array(evidence.failure_position)
    return [float(np.linalg.norm(evidence.centroid(partition) - end)) for partition in partitions]


def avg_trajectory_proximal(partitions: list[Partition], evidence: Evidence) -> list[float]:
    """Distance of each partition's centroid to the robot, averaged over the time of its last similar run, m."""
    path = evidence.trajectory[:, 1:4]
    return [float(np.linalg.norm(path - evidence.centroid(partition), axis=1).mean()) for partition in partitions]


def sequential(partitions: list[Partition], evidence: Evidence) -> list[float]:
    """Where in the world file the partition's first model stands."""
    place = {name: index for index, name in enumerate(evidence.positions)}
    return [float(min(place[name] for name in partition)) for partition in partitions]


def random(partitions: list[Partition], evidence: Evidence) -> list[float]:
    """A shuffle that the seed and the round's partitions fix."""
    models = sum(len(partition) for partition in partitions)
    return np.random.default_rng([evidence.seed, models, len(partitions)]).random(len(partitions)).tolist()


PRIORITIZATIONS: dict[str, Prioritization] = {
    "failure-proximal": failure_proximal,
    "avg-trajectory-proximal": avg_trajectory_proximal,
    "sequential": sequential,
    "random": random,
}
# Schemas whose score is a distance in m, which is worth showing.
DISTANCES = frozenset({"failure-proximal", "avg-trajectory-proximal"})
