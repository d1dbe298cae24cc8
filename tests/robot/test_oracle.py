"""When is a failure the same failure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.robot.oracle import Failure, judge, trajectory_distance
from ddenv.robot.result import RunResult


def path(*points) -> np.ndarray:
    """A trajectory with one point a second, upright."""
    return np.array([(float(time), *point, 1.0, 0.0, 0.0, 0.0) for time, point in enumerate(points)])


def result(outcome: str, trajectory: np.ndarray) -> RunResult:
    failure = {"failed": "stuck", "error": "not-finite"}.get(outcome, "")
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


numbers = st.floats(-20, 20)


@st.composite
def ways(draw) -> np.ndarray:
    """A trajectory with a row every 0.1 s and one at its end, as runs have it."""
    length = draw(st.integers(1, 30))
    steps = draw(st.lists(st.tuples(numbers, numbers, numbers), min_size=length, max_size=length))
    rest = draw(st.sampled_from([0.0, 0.035]))
    return np.array(
        [(0.1 * row + (rest if row == length - 1 else 0), *step, 1, 0, 0, 0) for row, step in enumerate(steps)]
    )


def waiting(trajectory: np.ndarray, times: np.ndarray) -> np.ndarray:
    """The trajectory with rows at all later `times`, at its end."""
    later = times[times > trajectory[-1, 0]]
    return np.vstack([trajectory, *([[time, *trajectory[-1, 1:]]] for time in later)])


@given(ways(), ways())
def test_a_run_that_was_cut_waits_at_its_end(cut, f):
    """Whether a robot that stands still is watched to the end or not makes no difference."""
    assert trajectory_distance(cut, f) == pytest.approx(trajectory_distance(waiting(cut, f[:, 0]), f))


@given(ways(), ways(), st.floats(0.01, 50))
def test_similar_trajectories_have_similar_ends(a, b, epsilon):
    f = Failure(tuple(b[-1, 1:4]), b, epsilon)
    along = judge(result("failed", a), replace(f, similarity="trajectory"))
    assert along.outcome == "other" or judge(result("failed", a), f).outcome == "similar"
    assert (along.outcome == "similar") == (max(along.distance, trajectory_distance(a, b)) <= epsilon)
