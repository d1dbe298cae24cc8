"""Fixes the failure f from runs of the whole world, and computes how likely it is to show again."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ddenv.engine.judging import end_of
from ddenv.rates import iterations_needed, miss_chance, wilson_interval
from ddenv.robot.oracle import Failure, judge_trajectory, medoid
from ddenv.runfile.state import Test
from ddenv.world.scenario import FailureSpec


def fix_failure(
    tests: Sequence[Test], trajectories: Mapping[int, np.ndarray], spec: FailureSpec, iterations: int
) -> dict[str, Any] | str:
    """The data of the `baseline_finished` event: f is the medoid of the failing end positions.

    `trajectories` are those of the failing tests, by id. If no run failed, returns a line that tells the user so. The rate
    counts f only, not other failures.
    """
    failing = [test for test in tests if test.outcome == "failed" and test.end_pose is not None]
    if not failing:
        return _no_failure(tests)
    first = failing[medoid(np.array([end_of(test) for test in failing]))]
    failure = Failure(end_of(first), trajectories[first.id], spec.epsilon, spec.similarity)
    judged = {test.id: judge_trajectory(trajectories[test.id], failure) for test in failing}
    similar = sum(judgement.outcome == "similar" for judgement in judged.values())
    rate = similar / len(tests)
    low, high = wilson_interval(similar, len(tests))
    return {
        "runs": len(tests),
        "failures": similar,
        "rate": rate,
        "low": low,
        "high": high,
        "failure_test": first.id,
        "position": failure.position,
        "miss_chance": miss_chance(rate, iterations),
        "iterations_95": iterations_needed(rate),
        "outcomes": {str(id): judgement.outcome for id, judgement in judged.items()},
        "distances": {str(id): judgement.distance for id, judgement in judged.items()},
    }


def _no_failure(tests: Sequence[Test]) -> str:
    broken = [test for test in tests if test.outcome in ("error", "timeout")]
    if len(broken) == len(tests):
        return f"no baseline run came to its end: {broken[0].failure}"
    reached = len(tests) - len(broken)
    also = f" ({len(broken)} more broke: {broken[0].failure})" if broken else ""
    return f"the robot reached its goal in all {reached} baseline runs{also}: there is no failure to reduce"
