"""First sensed, first tried."""

from __future__ import annotations

import math
from collections.abc import Sequence

from ddenv.reduction.evidence import Evidence, Partition


def timestep(partitions: Sequence[Partition], evidence: Evidence) -> list[float]:
    """Partitions are tried in the order in which the robot first sensed any of their models on its last similar run: by touch, or
    within the range and the field of view of its sensors. Those that it never sensed come last. Good when an early disturbance
    leads to the failure.

    The scores are in s.
    """
    first = evidence.need("first_sensed")
    return [min((first.get(name, math.inf) for name in partition), default=math.inf) for partition in partitions]
