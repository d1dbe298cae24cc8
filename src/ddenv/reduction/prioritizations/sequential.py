"""In the order of the world."""

from __future__ import annotations

from collections.abc import Sequence

from ddenv.reduction.evidence import Evidence, Partition


def sequential(partitions: Sequence[Partition], evidence: Evidence) -> list[float]:
    """Partitions are tried in the order in which their first models stand in the world file. It knows nothing of the failure: a
    yardstick for the schemas that do, or right where the order of the file means something.

    The scores are places in the file.
    """
    place = {name: index for index, name in enumerate(evidence.elements)}
    return [float(min(place[name] for name in partition)) for partition in partitions]
