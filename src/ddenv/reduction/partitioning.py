"""How the environment is split: the partitioning schemas of the paper's Table I.

A schema takes the environment, n and the evidence, and gives at most n disjoint, non-empty partitions that cover it.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from itertools import pairwise

import numpy as np
from sklearn.cluster import KMeans
from sklearn.exceptions import ConvergenceWarning
from threadpoolctl import threadpool_limits

from ddenv.reduction.evidence import Evidence, Partition

Partitioning = Callable[[Partition, int, Evidence], list[Partition]]


def one_model_partitions(environment: Partition) -> list[Partition]:
    """Each model on its own."""
    return [(name,) for name in environment]


def model2model(environment: Partition, n_partitions: int, evidence: Evidence) -> list[Partition]:
    """Spatial clusters of models by k-means (paper, Algorithm 2); one-model partitions where k-means leaves a cluster empty."""
    clusters = KMeans(n_clusters=n_partitions, n_init=4, random_state=evidence.seed)
    # One thread, so that sums are added in one order and a resumed run sees the same clusters.
    with warnings.catch_warnings(), threadpool_limits(1):
        warnings.simplefilter("ignore", ConvergenceWarning)
        labels = clusters.fit(evidence.places(environment)).labels_
    partitions = _grouped(environment, labels)
    return partitions if len(partitions) == n_partitions else one_model_partitions(environment)


def timeseg(environment: Partition, n_partitions: int, evidence: Evidence) -> list[Partition]:
    """The last similar run cut into n spans of equal duration; a model belongs to the span whose path is nearest to it."""
    times = evidence.trajectory[:, 0]
    cuts = np.linspace(times[0], times[-1], n_partitions + 1)
    distances = [_distance_to_path(evidence, environment, a, b) for a, b in pairwise(cuts)]
    return _grouped(environment, np.argmin(distances, axis=0))


PARTITIONINGS: dict[str, Partitioning] = {"model2model": model2model, "timeseg": timeseg}


def _grouped(environment: Partition, labels: np.ndarray) -> list[Partition]:
    groups: dict[int, list[str]] = {}
    for name, label in zip(environment, labels, strict=True):
        groups.setdefault(int(label), []).append(name)
    return [tuple(groups[label]) for label in sorted(groups)]


def _distance_to_path(evidence: Evidence, environment: Partition, start: float, end: float) -> np.ndarray:
    """Distance of each model to the path driven from `start` to `end` s, shape (len(environment),), m."""
    times, path = evidence.trajectory[:, 0], evidence.trajectory[:, 1:4]
    inside = path[(times > start) & (times < end)]
    ends = [[np.interp(at, times, path[:, axis]) for axis in range(3)] for at in (start, end)]
    points = np.vstack([ends[0], inside, ends[1]])
    return distance_to_segments(evidence.places(environment), points).min(axis=1)


def distance_to_segments(places: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Distance of each place (M, 3) to each segment between neighbouring points (N, 3): shape (M, N - 1), m."""
    starts, steps = points[:-1], np.diff(points, axis=0)
    lengths = np.einsum("ij,ij->i", steps, steps)
    along = np.einsum("mij,ij->mi", places[:, None, :] - starts, steps)
    fraction = np.clip(along / np.where(lengths > 0, lengths, 1.0), 0.0, 1.0)
    nearest = starts + fraction[:, :, None] * steps
    return np.linalg.norm(places[:, None, :] - nearest, axis=2)
