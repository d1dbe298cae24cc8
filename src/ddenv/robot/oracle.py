"""The failure oracle: did a run show f, the failure that is being debugged?"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ddenv.robot.result import RunResult
from ddenv.world.pose import Vector


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
