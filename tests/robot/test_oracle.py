"""When is a failure the same failure."""

from __future__ import annotations

import numpy as np
import pytest

from ddenv.robot.oracle import Failure, judge, medoid, trajectory_distance
from ddenv.robot.result import RunResult


def path(*points) -> np.ndarray:
    """A trajectory with one point a second, upright."""
    return np.array([(float(time), *point, 1.0, 0.0, 0.0, 0.0) for time, point in enumerate(points)])


def result(outcome: str, trajectory: np.ndarray) -> RunResult:
    failure = {"failed": "timeout", "error": "not-finite"}.get(outcome, "")
    return RunResult(outcome, failure, trajectory, {}, float(trajectory[-1, 0]), 0.1, 0)


WAY = path((0, 0, 0), (1, 0, 0), (2, 0, 0))
F = Failure((2.0, 0.0, 0.0), WAY, epsilon=0.5)


@pytest.mark.parametrize(
    ("end", "outcome"),
    [((2, 0.5, 0), "similar"), ((2, 0.51, 0), "other"), ((2, 0, 0.5), "similar"), ((2, 0, -1), "other")],
)
def test_similar_within_epsilon_in_all_three_dimensions(end, outcome):
    judgement = judge(result("failed", path((0, 0, 0), (1, 0, 0), end)), F)
    assert judgement.outcome == outcome
    assert judgement.distance == pytest.approx(np.linalg.norm(np.subtract(end, F.position)))


@pytest.mark.parametrize("outcome", ["pass", "error"])
def test_a_pass_or_an_error_is_never_similar(outcome):
    judgement = judge(result(outcome, WAY), F)
    assert judgement.outcome == outcome
    assert judgement.distance == 0.0


def test_a_detour_to_the_same_end_is_another_failure_if_the_way_counts():
    detour = result("failed", path((0, 0, 0), (1, 5, 0), (2, 0, 0)))
    assert judge(detour, F).outcome == "similar"
    assert judge(detour, Failure(F.position, WAY, 0.5, "trajectory")).outcome == "other"
    assert judge(result("failed", WAY), Failure(F.position, WAY, 0.5, "trajectory")).outcome == "similar"


def test_trajectories_are_compared_at_equal_times():
    assert trajectory_distance(WAY, path((0, 1, 0), (1, 1, 0), (2, 1, 0))) == pytest.approx(1.0)
    assert trajectory_distance(WAY, WAY[::2]) == pytest.approx(0.0)
    # The shorter one waits at its end: 0, 0 and 1 m apart.
    assert trajectory_distance(WAY, WAY[:2]) == pytest.approx(1 / 3)


def test_medoid_is_the_position_nearest_to_all_others():
    positions = np.array([[0, 0, 0], [0.1, 0, 0], [0.3, 0, 0], [9, 9, 9]], dtype=float)
    assert medoid(positions) == 1
    assert medoid(positions[3:]) == 0
