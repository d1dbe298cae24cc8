"""Nearest to the whole trajectory first."""

from __future__ import annotations

from collections.abc import Sequence

from scipy.spatial.distance import cdist

from ddenv.reduction.evidence import Evidence, Partition


def avg_trajectory_proximal(partitions: Sequence[Partition], evidence: Evidence) -> list[float]:
    """Partitions whose centroid is near the robot on average, over the whole time of its last similar run, are tried first. What
    disturbed the robot before it failed counts as well as what stood where it failed.

    The scores are distances in m.
    """
    return cdist(evidence.centroids(partitions), evidence.path()).mean(axis=1).tolist()
