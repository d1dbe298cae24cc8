"""Nearest to any place of the trajectory first."""

from __future__ import annotations

from collections.abc import Sequence

from ddenv.reduction.evidence import Evidence, Partition
from ddenv.reduction.geometry import nearest_on_path


def min_trajectory_proximal(partitions: Sequence[Partition], evidence: Evidence) -> list[float]:
    """Partitions whose centroid the robot came nearest to, at any moment of its last similar run, are tried first. What it only
    passed counts as much as what it failed at.

    The scores are distances in m, to the segments of the path.
    """
    times = evidence.need("trajectory")[:, 0]
    return nearest_on_path(evidence.centroids(partitions), times, evidence.path())[0].tolist()
