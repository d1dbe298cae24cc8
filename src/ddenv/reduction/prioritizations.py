"""The prioritizations: in which order a round tries its partitions. One function for each; the
lowest score is tried first.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from scipy.spatial.distance import cdist

from ddenv.reduction.evidence import Evidence, nearest_on_path
from ddenv.text import Names


def failure_proximal(partitions: Sequence[Names], evidence: Evidence) -> list[float]:
    """Partitions whose centroid is near the place where the robot failed are tried first. Good if
    the cause stands where the robot got stuck; it ignores what happened on the way there.

    Paper, Algorithm 3. The scores are distances in m.
    """
    end = np.array(evidence.need("failure_position"))
    return list(np.linalg.norm(evidence.centroids(partitions) - end, axis=1))


def avg_trajectory_proximal(partitions: Sequence[Names], evidence: Evidence) -> list[float]:
    """Partitions whose centroid has the smallest mean distance to the robot, over its whole last
    similar run, are tried first. What disturbed the robot early counts as much as what stood where
    it failed.

    The scores are distances in m.
    """
    return list(cdist(evidence.centroids(partitions), evidence.path()).mean(axis=1))


def min_trajectory_proximal(partitions: Sequence[Names], evidence: Evidence) -> list[float]:
    """Partitions whose centroid the robot came nearest to, at any time of its last similar run, are
    tried first. Models that it only passed count as much as those it failed at.

    The scores are distances in m, to the segments of the path.
    """
    times = evidence.need("trajectory")[:, 0]
    return list(nearest_on_path(evidence.centroids(partitions), times, evidence.path())[0])


def timestep(partitions: Sequence[Names], evidence: Evidence) -> list[float]:
    """Partitions are tried in the order in which the robot first sensed any of their models in its
    last similar run: by touch, or within the range and the field of view of its sensors. Partitions
    that it never sensed come last. Good if an early disturbance leads to the failure.

    The scores are in s.
    """
    first = evidence.need("first_sensed")
    return [
        min((first.get(name, math.inf) for name in partition), default=math.inf)
        for partition in partitions
    ]


def sequential(partitions: Sequence[Names], evidence: Evidence) -> list[float]:
    """Partitions are tried in the order in which their first models appear in the world file. It
    ignores the failure: a yardstick for the schemas that do not, and a good choice if the order of
    the file means something.

    The scores are places in the file.
    """
    place = {name: index for index, name in enumerate(evidence.elements)}
    return [float(min(place[name] for name in partition)) for partition in partitions]


def random(partitions: Sequence[Names], evidence: Evidence) -> list[float]:
    """Partitions are tried in a random order, fixed by the seed and the round, so that repeated
    runs use the same order. The baseline that every other prioritization has to beat.

    The scores mean nothing.
    """
    models = sum(len(partition) for partition in partitions)
    order = np.random.default_rng([evidence.seed, models, len(partitions)])
    return list(order.random(len(partitions)))
