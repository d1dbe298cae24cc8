"""Prioritizations: which partitions are tried first. Each returns a score for each partition, the lowest first."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.spatial.distance import cdist

from ddenv.reduction.evidence import Evidence, Partition, nearest_on_path


def failure_proximal(partitions: Sequence[Partition], evidence: Evidence) -> list[float]:
    """Partitions whose centroid is near the place where the robot failed are tried first. Good when the cause stands where the
    robot got stuck; what happened on the way there is not looked at.

    Paper, Algorithm 3. The scores are distances in m.
    """
    end = np.array(evidence.need("failure_position"))
    return np.linalg.norm(evidence.centroids(partitions) - end, axis=1).tolist()


def avg_trajectory_proximal(partitions: Sequence[Partition], evidence: Evidence) -> list[float]:
    """Partitions whose centroid is near the robot on average, over the whole time of its last similar run, are tried first. What
    disturbed the robot before it failed counts as well as what stood where it failed.

    The scores are distances in m.
    """
    return cdist(evidence.centroids(partitions), evidence.path()).mean(axis=1).tolist()


def min_trajectory_proximal(partitions: Sequence[Partition], evidence: Evidence) -> list[float]:
    """Partitions whose centroid the robot came nearest to, at any moment of its last similar run, are tried first. What it only
    passed counts as much as what it failed at.

    The scores are distances in m, to the segments of the path.
    """
    times = evidence.need("trajectory")[:, 0]
    return nearest_on_path(evidence.centroids(partitions), times, evidence.path())[0].tolist()


def timestep(partitions: Sequence[Partition], evidence: Evidence) -> list[float]:
    """Partitions are tried in the order in which the robot first sensed any of their models on its last similar run: by touch, or
    within the range and the field of view of its sensors. Those that it never sensed come last. Good when an early disturbance
    leads to the failure.

    The scores are in s.
    """
    first = evidence.need("first_sensed")
    return [min((first.get(name, math.inf) for name in partition), default=math.inf) for partition in partitions]


def sequential(partitions: Sequence[Partition], evidence: Evidence) -> list[float]:
    """Partitions are tried in the order in which their first models stand in the world file. It knows nothing of the failure: a
    yardstick for the schemas that do, or right where the order of the file means something.

    The scores are places in the file.
    """
    place = {name: index for index, name in enumerate(evidence.elements)}
    return [float(min(place[name] for name in partition)) for partition in partitions]


def random(partitions: Sequence[Partition], evidence: Evidence) -> list[float]:
    """Partitions are tried in a random order, which the seed and the round fix: the same run shuffles in the same way. What any
    other prioritization has to beat.

    The scores mean nothing.
    """
    models = sum(len(partition) for partition in partitions)
    return np.random.default_rng([evidence.seed, models, len(partitions)]).random(len(partitions)).tolist()
