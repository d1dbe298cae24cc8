"""The failure oracle: did a run show f, the failure that is being debugged?"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ddenv.robot.result import RunResult
from ddenv.world.pose import Pose, Vector

# A robot that leans more than this stands on its wheels no more, rad.
LEAN = math.radians(60)

# Going down so far (m) in so short a time (s) is falling: 1.7 m/s down is faster than wheels go down any slope that they hold on
# to, and whatever falls freely goes down 1.8 m in that time.
DROP, DROP_SECONDS = 1.0, 0.6
# A robot may be put down from above its ground when a run begins, s.
SETTLING = 1.0

# Within half a robot's length (m) of its end for so long (s). A robot that gets on leaves such a circle in a second or two; one
# that tries in vain to get free, back and forth, stays. It is shorter than what `Stuck` waits for, so that a run that was cut
# is stuck here as well.
STILL, STILL_SECONDS = 0.5, 6.0


def kind_of(trajectory: np.ndarray, fell: bool, arrived: float | None) -> str:
    """How a run that did not reach its goal failed. `trajectory` (N, 8) is as in `RunResult`.

    `fell` says that the robot is below everything that it could stand on, `arrived` is when (s) it began to believe that it is at
    the goal, if ever. The first of these that is true:

    fell         below everything, or more than 1 m down at once and not up again
    tipped over  what was up at the start leans more than 60 degrees at the end
    lost         it came to believe that it has arrived, and was not stuck by then: wheels that spin in a rut take nobody anywhere
    stuck        in the last 6 s (or the last half of a shorter run) never more than 0.5 m from its end
    out of time  still on its way
    """
    if fell or _dropped(trajectory):
        return "fell"
    if _lean(trajectory) > LEAN:
        return "tipped over"
    if arrived is not None and not _is_still(trajectory[trajectory[:, 0] <= max(arrived, trajectory[0, 0])]):
        return "lost"
    return "stuck" if _is_still(trajectory) else "out of time"


def _dropped(trajectory: np.ndarray) -> bool:
    """Whether it fell down somewhere and ended about as far down or farther."""
    times, heights = trajectory[:, 0], trajectory[:, 3]
    before = np.searchsorted(times, times - DROP_SECONDS - 1e-9)
    fallen = (heights[before] - heights > DROP) & (times[before] >= SETTLING) & (heights[before] - heights[-1] > DROP)
    return bool(fallen.any())


def _lean(trajectory: np.ndarray) -> float:
    """The angle between the vertical and the axis of the robot that was vertical at the start, rad."""
    start, end = (Pose(quaternion=tuple(map(float, trajectory[row, 4:]))) for row in (0, -1))
    up = end.rotate(start.inverse().rotate((0.0, 0.0, 1.0)))
    return math.acos(max(-1.0, min(1.0, up[2])))


def _is_still(trajectory: np.ndarray) -> bool:
    times = trajectory[:, 0]
    since = times[-1] - min(STILL_SECONDS, (times[-1] - times[0]) / 2)
    last = trajectory[times >= since, 1:4]
    return bool(np.linalg.norm(last - last[-1], axis=1).max() <= STILL)


@dataclass(frozen=True)
class Failure:
    """f: where the robot was when its time ran out (`position`, m), and how it got there.

    `trajectory` has shape (N, 8), see `RunResult`. A run is similar within `epsilon` m of f: at its end
    (`similarity` "end-pose"), or also on average along the way ("trajectory").
    """

    position: Vector
    trajectory: np.ndarray
    epsilon: float
    similarity: str = "end-pose"


@dataclass(frozen=True)
class Judgement:
    """`outcome` is "similar", "other", "pass" or "error"; `distance` between the ends, `trajectory_distance` on average, m."""

    outcome: str
    distance: float
    trajectory_distance: float


def medoid(positions: np.ndarray) -> int:
    """The index of the position (N, 3) that is nearest to all the others together."""
    return int(np.argmin(np.linalg.norm(positions[:, None] - positions[None, :], axis=2).sum(axis=1)))


def judge(result: RunResult, failure: Failure) -> Judgement:
    """What came out of a run, seen from f (paper, `is_similar_failure`)."""
    judgement = judge_trajectory(result.trajectory, failure)
    if result.outcome == "failed":
        return judgement
    return Judgement(result.outcome, judgement.distance, judgement.trajectory_distance)


def judge_trajectory(trajectory: np.ndarray, failure: Failure) -> Judgement:
    """Whether the trajectory (N, 8) of a failed run shows f ("similar") or another failure ("other")."""
    distance = float(np.linalg.norm(trajectory[-1, 1:4] - failure.position))
    along = trajectory_distance(trajectory, failure.trajectory)
    similar = distance <= failure.epsilon and (failure.similarity == "end-pose" or along <= failure.epsilon)
    return Judgement("similar" if similar else "other", distance, along)


def trajectory_distance(a: np.ndarray, b: np.ndarray) -> float:
    """Mean distance between two trajectories at equal times, m; the shorter one (of a run that was cut) waits at its end."""
    times = np.union1d(a[:, 0], b[:, 0])
    gaps = [np.interp(times, a[:, 0], a[:, axis]) - np.interp(times, b[:, 0], b[:, axis]) for axis in (1, 2, 3)]
    return float(np.linalg.norm(gaps, axis=0).mean())
