"""The ends that count as f: the baseline's, and those of other failures that the user took for as good."""

from __future__ import annotations

from typing import Any

import numpy as np

from ddenv.engine.told import nearest
from ddenv.robot.oracle import Failure, judge_trajectory
from ddenv.runfile.state import RunState
from ddenv.runfile.store import COLUMNS, RunFile
from ddenv.world.scenario import FailureSpec


def failures_of(file: RunFile, state: RunState, spec: FailureSpec) -> tuple[Failure, ...]:
    """f first; none before it is fixed. Raises UserError for a damaged run file."""
    return tuple(failure_of(file, state, test, spec) for test in state.failures)


def failure_of(file: RunFile, state: RunState, test: int, spec: FailureSpec) -> Failure:
    """The failure that a test showed. Raises UserError for a damaged run file."""
    f = state.baseline
    end = f.position if test == f.failure_test else state.tests[test - 1].end_pose[:3]
    return Failure(end, rows_of(file, test), spec.epsilon, spec.similarity)


def rejudged(file: RunFile, state: RunState, failures: tuple[Failure, ...]) -> dict[str, dict[str, Any]]:
    """What all failed tests so far are, seen from `failures`: their outcomes, and distances in m, by the test's id."""
    outcomes, distances = {}, {}
    for test in state.tests:
        if test.outcome not in ("similar", "other"):
            continue
        judged = nearest([judge_trajectory(rows_of(file, test.id), failure) for failure in failures])
        outcomes[str(test.id)], distances[str(test.id)] = judged.outcome, judged.distance
    return {"outcomes": outcomes, "distances": distances}


def rows_of(file: RunFile, test: int) -> np.ndarray:
    """The robot's trajectory in a test, shape (N, COLUMNS). Raises UserError where there is none."""
    return np.array(file.trajectory(test)).reshape(-1, COLUMNS)
