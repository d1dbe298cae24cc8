"""Partitions by where models are."""

from __future__ import annotations

import warnings

from sklearn.cluster import KMeans
from sklearn.exceptions import ConvergenceWarning
from threadpoolctl import threadpool_limits

from ddenv.reduction.evidence import Evidence, Partition
from ddenv.reduction.partitionings.grouped import grouped
from ddenv.reduction.round import one_model_partitions

# Above so many clusters or models k-means begins once instead of four times, and above so many clusters at random models: it
# would take a second instead of a tenth.
MANY_CLUSTERS, MANY_MODELS, MOST_CLUSTERS = 100, 500, 500


def model2model(environment: Partition, n_partitions: int, evidence: Evidence) -> list[Partition]:
    """Models that are near each other make a partition: k-means on their positions finds n clusters in space. Where it leaves a
    cluster empty, because models stand in the same place, each model becomes a partition of its own for this round. Good when what
    causes a failure stands close together.

    Paper, Algorithm 2.
    """
    many = n_partitions > MANY_CLUSTERS or len(environment) > MANY_MODELS
    clusters = KMeans(
        n_clusters=n_partitions,
        init="random" if n_partitions > MOST_CLUSTERS else "k-means++",
        n_init=1 if many else 4,
        random_state=evidence.seed,
    )
    # One thread, so that sums are added in one order and a resumed run sees the same clusters.
    with warnings.catch_warnings(), threadpool_limits(1):
        warnings.simplefilter("ignore", ConvergenceWarning)
        labels = clusters.fit(evidence.places(environment)).labels_
    partitions = grouped(environment, labels)
    return partitions if len(partitions) == n_partitions else one_model_partitions(environment)
