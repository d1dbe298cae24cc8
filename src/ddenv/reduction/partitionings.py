"""The partitionings: how a round splits the environment. One function for each, except for
`learner.py`.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterable

import numpy as np
from sklearn.cluster import KMeans
from sklearn.exceptions import ConvergenceWarning
from threadpoolctl import threadpool_limits

from ddenv.arrays import Floats
from ddenv.reduction.evidence import Evidence
from ddenv.text import Names

# With more clusters or models than this, k-means starts once instead of four times, and with more
# clusters than this from random models: it would take a second instead of a tenth.
MANY_CLUSTERS = 100
MANY_MODELS = 500
MOST_CLUSTERS = 500


def model2model(environment: Names, n_partitions: int, evidence: Evidence) -> list[Names]:
    """Models that are near each other form a partition: k-means clusters their positions into n
    groups. If a cluster stays empty, because models share a position, each model is its own
    partition in this round. Good if the models that cause a failure stand close together.

    Paper, Algorithm 2.
    """
    many = n_partitions > MANY_CLUSTERS or len(environment) > MANY_MODELS
    clusters = KMeans(
        n_clusters=n_partitions,
        init="random" if n_partitions > MOST_CLUSTERS else "k-means++",
        n_init=1 if many else 4,
        random_state=evidence.seed,
    )
    # One thread, so that sums are added in one order and a resumed run gets the same clusters.
    with warnings.catch_warnings(), threadpool_limits(1):
        warnings.simplefilter("ignore", ConvergenceWarning)
        labels = clusters.fit(evidence.places(environment)).labels_
    partitions = grouped(environment, labels)
    if len(partitions) == n_partitions:
        return partitions
    return [(name,) for name in environment]


def timeseg(environment: Names, n_partitions: int, evidence: Evidence) -> list[Names]:
    """The trajectory of the last similar run is cut into n spans of equal duration. A model belongs
    to the span whose path is nearest to it. If the robot is stuck for long, many spans lie at that
    place, so the models there are soon separated from the rest. Good if it matters when the robot
    met a model.
    """
    times = evidence.need("trajectory")[:, 0]
    return by_span(environment, np.linspace(times[0], times[-1], n_partitions + 1)[1:-1], evidence)


def trajectoryseg(environment: Names, n_partitions: int, evidence: Evidence) -> list[Names]:
    """The trajectory of the last similar run is cut where the robot's angular velocity changes by
    more than delta (rad/s, the scenario's key `reduction.delta`). A model belongs to the span whose
    path is nearest to it. If there are too many cuts, the n - 1 sharpest are kept; if too few, the
    longest spans are halved. Good if the robot's turns show where something happened.
    """
    trajectory = evidence.need("trajectory")
    return by_span(environment, cuts(trajectory, evidence.delta, n_partitions), evidence)


def by_span(environment: Names, cuts: Floats, evidence: Evidence) -> list[Names]:
    """Groups the models by the span of time, between sorted `cuts` (s), in which the robot was
    nearest to them.
    """
    return grouped(
        environment, np.searchsorted(cuts, evidence.nearest(environment)[:, 1], side="left")
    )


def cuts(trajectory: Floats, delta: float, n_spans: int) -> Floats:
    """The times (s) at which the trajectory (N, 5) is cut into `n_spans`, sorted, shape (n_spans -
    1,).
    """
    times = trajectory[:, 0]
    lasted = np.diff(trajectory[:, 0])
    turn_rates = np.diff(np.unwrap(trajectory[:, 4])) / np.where(lasted > 0, lasted, np.inf)
    sharpness = np.abs(np.diff(turn_rates))
    sharp = np.flatnonzero(sharpness > delta)
    sharpest = sharp[np.argsort(-sharpness[sharp], kind="stable")][: n_spans - 1]
    chosen = sorted({float(time) for time in times[1:-1][sharpest]})
    ends = [float(times[0]), *chosen, float(times[-1])]
    while len(ends) - 1 < n_spans:
        longest = int(np.argmax(np.diff(ends)))
        ends.insert(longest + 1, (ends[longest] + ends[longest + 1]) / 2)
    return np.array(ends[1:-1])


def grouped(environment: Names, labels: Iterable[int]) -> list[Names]:
    """The models of each label, sorted by label; within a partition they keep the environment's
    order.
    """
    groups: dict[int, list[str]] = {}
    for name, label in zip(environment, labels, strict=True):
        groups.setdefault(int(label), []).append(name)
    return [tuple(groups[label]) for label in sorted(groups)]
