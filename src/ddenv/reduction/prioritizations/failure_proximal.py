"""Nearest to the failure first."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ddenv.reduction.evidence import Evidence, Partition


def failure_proximal(partitions: Sequence[Partition], evidence: Evidence) -> list[float]:
    """Partitions whose centroid is near the place where the robot failed are tried first. Good when the cause stands where the
    robot got stuck; what happened on the way there is not looked at.

    Paper, Algorithm 3. The scores are distances in m.
    """
    end = np.array(evidence.need("failure_position"))
    return np.linalg.norm(evidence.centroids(partitions) - end, axis=1).tolist()
