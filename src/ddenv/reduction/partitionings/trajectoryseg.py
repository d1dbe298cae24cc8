"""Partitions by the manoeuvres of the robot."""

from __future__ import annotations

import numpy as np

from ddenv.reduction.evidence import Evidence, Partition
from ddenv.reduction.partitionings.timeseg import by_span


def trajectoryseg(environment: Partition, n_partitions: int, evidence: Evidence) -> list[Partition]:
    """The trajectory of the last similar run is cut where the robot's angular velocity changes by more than delta (rad/s, the
    scenario's key `reduction.delta`); a model belongs to the span whose path is nearest to it. Of too many cuts the n - 1 sharpest
    are kept, and where there are too few, the longest spans are halved. Good when the robot's turns tell where something happened.
    """
    trajectory = evidence.need("trajectory")
    return by_span(environment, cuts(trajectory, evidence.delta, n_partitions), evidence)


def cuts(trajectory: np.ndarray, delta: float, n_spans: int) -> np.ndarray:
    """Where the trajectory (N, 5) is cut into `n_spans`: sorted times, shape (n_spans - 1,), s."""
    times, sharpness = turns(trajectory)
    sharp = np.flatnonzero(sharpness > delta)
    sharpest = sharp[np.argsort(-sharpness[sharp], kind="stable")][: n_spans - 1]
    chosen = sorted({float(time) for time in times[sharpest]})
    ends = [float(trajectory[0, 0]), *chosen, float(trajectory[-1, 0])]
    while len(ends) - 1 < n_spans:
        longest = int(np.argmax(np.diff(ends)))
        ends.insert(longest + 1, (ends[longest] + ends[longest + 1]) / 2)
    return np.array(ends[1:-1])


def turns(trajectory: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The inner times (s) of the trajectory (N, 5), and how much the angular velocity (rad/s) changes there: two (N - 2,)."""
    times, yaw = trajectory[:, 0], np.unwrap(trajectory[:, 4])
    lasted = np.diff(times)
    rates = np.diff(yaw) / np.where(lasted > 0, lasted, np.inf)
    return times[1:-1], np.abs(np.diff(rates))
