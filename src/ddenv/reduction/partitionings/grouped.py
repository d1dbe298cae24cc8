"""Labels to partitions."""

from __future__ import annotations

from collections.abc import Iterable

from ddenv.reduction.evidence import Partition


def grouped(environment: Partition, labels: Iterable[int]) -> list[Partition]:
    """The models of each label that occurs, by label; within a partition they stay in the environment's order."""
    groups: dict[int, list[str]] = {}
    for name, label in zip(environment, labels, strict=True):
        groups.setdefault(int(label), []).append(name)
    return [tuple(groups[label]) for label in sorted(groups)]
