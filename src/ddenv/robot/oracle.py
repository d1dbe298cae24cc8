"""The failure oracle: how a run failed, and whether it shows f, the failure that is being
debugged.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ddenv.arrays import Floats
from ddenv.robot.result import Ends, RunResult
from ddenv.world.pose import Pose, Vector

LEAN = math.radians(60)  # a robot that leans more than this no longer stands on its wheels, rad

# Descending this far (m) within this time (s) is a fall: 1.7 m/s downwards is faster than wheels
# descend any slope on which they have grip, and a free fall covers 1.8 m in that time.
DROP = 1.0
DROP_SECONDS = 0.6
SETTLING = 1.0  # a robot may drop onto the ground when a run begins, s

# Within half a robot's length (m) of its end for this time (s). A moving robot leaves such a circle
# in a second or two; one that rocks back and forth to get free stays.
STILL = 0.5
STILL_SECONDS = 6.0


def kind_of(trajectory: Floats, fell: bool, arrived: float | None) -> str:
    """How a run that did not reach its goal failed. `trajectory` (N, 8) is as in `RunResult`.

    `fell` is True if the robot is below everything that it could stand on. `arrived` is the time
    (s) when its controller first reported that it is at the goal, None if it never did. Returns the
    first of these that is true:

    fell         below everything, or more than 1 m down at once and not up again tipped over  at
    the end it leans more than 60 degrees from how it stood at the start lost         its pose
    estimate reached the goal, and it was not stuck by then: wheels that spin in a rut also move the
    estimate stuck        in the last 6 s (or the second half of a shorter run) never more than 0.5
    m from its end out of time  still moving
    """
    times = trajectory[:, 0]
    heights = trajectory[:, 3]
    before = np.searchsorted(times, times - DROP_SECONDS - 1e-9)
    fallen = (
        (heights[before] - heights > DROP)
        & (times[before] >= SETTLING)
        & (heights[before] - heights[-1] > DROP)
    )
    if fell or fallen.any():
        return "fell"
    (w, x, y, z), (ew, ex, ey, ez) = (trajectory[row, 4:].tolist() for row in (0, -1))
    start = Pose(quaternion=(w, x, y, z))
    end = Pose(quaternion=(ew, ex, ey, ez))
    up = end.rotate(start.inverse().rotate((0.0, 0.0, 1.0)))
    if math.acos(max(-1.0, min(1.0, up[2]))) > LEAN:
        return "tipped over"
    if arrived is not None and not _is_still(
        trajectory[trajectory[:, 0] <= max(arrived, trajectory[0, 0])]
    ):
        return "lost"
    if _is_still(trajectory):
        return "stuck"
    return "out of time"


def _is_still(trajectory: Floats) -> bool:
    times = trajectory[:, 0]
    since = times[-1] - min(STILL_SECONDS, (times[-1] - times[0]) / 2)
    last = trajectory[times >= since, 1:4]
    return bool(np.linalg.norm(last - last[-1], axis=1).max() <= STILL)


@dataclass(frozen=True)
class Failure:
    """f: where the robot was when its time ran out (`position`, m, world frame), and how it got
    there.

    `trajectory` (N, 8) is as in `RunResult`. A run shows f if it ends within `epsilon` (m) of
    `position` and, with `similarity` "trajectory" instead of "end-pose", is also on average within
    `epsilon` of the trajectory.
    """

    position: Vector
    trajectory: Floats
    epsilon: float
    similarity: str = "end-pose"


def ends_of(failures: Sequence[Failure]) -> Ends:
    """The ends of `failures`, of which there is at least one; they share their epsilon."""
    f = failures[0]
    positions = tuple(each.position for each in failures)
    return Ends(positions, f.epsilon, suffice=f.similarity == "end-pose")


@dataclass(frozen=True)
class Judgement:
    """`outcome` is "similar", "other", "pass" or "error"; `distance` is that between the ends,
    m.
    """

    outcome: str
    distance: float


def judge(result: RunResult, failure: Failure) -> Judgement:
    """The outcome of a run with regard to f (`is_similar_failure` of the paper)."""
    judgement = judge_trajectory(result.trajectory, failure)
    if result.outcome == "failed":
        return judgement
    return replace(judgement, outcome=result.outcome)


def judge_trajectory(trajectory: Floats, failure: Failure) -> Judgement:
    """Whether the trajectory (N, 8) of a failed run shows f ("similar") or another failure
    ("other").
    """
    distance = float(np.linalg.norm(trajectory[-1, 1:4] - failure.position))
    similar = distance <= failure.epsilon
    if similar and failure.similarity == "trajectory":
        similar = trajectory_distance(trajectory, failure.trajectory) <= failure.epsilon
    return Judgement("similar" if similar else "other", distance)


def trajectory_distance(a: Floats, b: Floats) -> float:
    """The mean distance of two trajectories (N, 8) at equal times, m. A shorter one, of a run that
    was cut, waits at its end.
    """
    times = np.union1d(a[:, 0], b[:, 0])
    gaps = [
        np.interp(times, a[:, 0], a[:, axis]) - np.interp(times, b[:, 0], b[:, axis])
        for axis in (1, 2, 3)
    ]
    return float(np.linalg.norm(gaps, axis=0).mean())
