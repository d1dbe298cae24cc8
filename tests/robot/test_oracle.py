"""How a robot failed, and when two failures are the same."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.robot.oracle import Failure, judge, kind_of, trajectory_distance
from ddenv.robot.result import RunResult


def path(*points) -> np.ndarray:
    """A trajectory with one point a second, upright."""
    return np.array(
        [(float(time), *point, 1.0, 0.0, 0.0, 0.0) for time, point in enumerate(points)]
    )


def result(outcome: str, trajectory: np.ndarray) -> RunResult:
    failure = {"failed": "stuck", "error": "not-finite"}.get(outcome, "")
    return RunResult(
        outcome=outcome,
        failure=failure,
        trajectory=trajectory,
        motions={},
        simulated_seconds=float(trajectory[-1, 0]),
        wall_seconds=0.1,
        seed=0,
    )


WAY = path((0, 0, 0), (1, 0, 0), (2, 0, 0))
F = Failure((2.0, 0.0, 0.0), WAY, epsilon=0.5)


@pytest.mark.parametrize(
    ("end", "outcome"),
    [
        ((2, 0.5, 0), "similar"),
        ((2, 0.51, 0), "other"),
        ((2, 0, 0.5), "similar"),
        ((2, 0, -1), "other"),
    ],
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
    assert (
        judge(result("failed", WAY), Failure(F.position, WAY, 0.5, "trajectory")).outcome
        == "similar"
    )


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
        [
            (0.1 * row + (rest if row == length - 1 else 0), *step, 1, 0, 0, 0)
            for row, step in enumerate(steps)
        ]
    )


def waiting(trajectory: np.ndarray, times: np.ndarray) -> np.ndarray:
    """The trajectory with rows at all later `times`, at its end."""
    later = times[times > trajectory[-1, 0]]
    return np.vstack([trajectory, *([[time, *trajectory[-1, 1:]]] for time in later)])


@given(ways(), ways())
def test_the_distance_of_trajectories_is_one(a, b):
    distance = trajectory_distance(a, b)
    assert distance == pytest.approx(trajectory_distance(b, a))
    assert trajectory_distance(a, a) == 0.0
    farthest = max(np.linalg.norm(p - q) for p in a[:, 1:4] for q in b[:, 1:4])
    assert 0.0 <= distance <= farthest + 1e-9


@given(ways(), ways())
def test_a_run_that_was_cut_waits_at_its_end(cut, f):
    """Whether a robot that stands still is watched to the end or not makes no difference."""
    assert trajectory_distance(cut, f) == pytest.approx(
        trajectory_distance(waiting(cut, f[:, 0]), f)
    )


@given(ways(), st.tuples(numbers, numbers, numbers))
def test_the_same_way_elsewhere_is_as_far_as_it_was_moved(way, shift):
    moved = way.copy()
    moved[:, 1:4] += shift
    assert trajectory_distance(way, moved) == pytest.approx(np.linalg.norm(shift), abs=1e-9)


@given(ways(), ways(), st.floats(0.01, 50))
def test_similar_trajectories_have_similar_ends(a, b, epsilon):
    f = Failure(tuple(b[-1, 1:4]), b, epsilon)
    along = judge(result("failed", a), replace(f, similarity="trajectory"))
    assert along.outcome == "other" or judge(result("failed", a), f).outcome == "similar"
    assert (along.outcome == "similar") == (
        max(along.distance, trajectory_distance(a, b)) <= epsilon
    )


def way(seconds: float, place, turn=lambda t: (1.0, 0.0, 0.0, 0.0)) -> np.ndarray:
    """A trajectory with a row every 0.1 s: `place(t)` is x, y, z, `turn(t)` a quaternion."""
    times = np.arange(0.0, seconds + 0.05, 0.1)
    return np.array([(t, *place(t), *turn(t)) for t in times])


def rolled(degrees: float) -> tuple[float, ...]:
    half = math.radians(degrees) / 2
    return math.cos(half), math.sin(half), 0.0, 0.0


def kind(trajectory: np.ndarray, *, fell: bool = False, arrived: float | None = None) -> str:
    return kind_of(trajectory, fell, arrived)


def standing(_: float) -> tuple[float, float, float]:
    return 0.0, 0.0, 0.0


def leaning(degrees: float, first: float, last: float = math.inf):
    """Leans so far between two times."""
    return lambda t: rolled(degrees if first < t < last else 0)


def falling(deep: float, start: float, end: float | None = None) -> np.ndarray:
    """Falls freely from `start` s on until it lies `deep` m lower; at the end it is at the height
    `end`.
    """
    rows = way(20, lambda t: (t, 0, 2 - min(deep, 4.9 * max(0.0, t - start) ** 2)))
    rows[-1, 3] = rows[-1, 3] if end is None else end
    return rows


WORDS = {
    "stood still": (way(30, lambda t: (min(t, 20), 0, 0)), "stuck"),
    "for just long enough": (way(30, lambda t: (min(t, 23.5), 0, 0)), "stuck"),
    "for too short a time": (way(30, lambda t: (min(t, 26), 0, 0)), "out of time"),
    "back and forth in a corner": (way(30, lambda t: (0.2 * math.sin(2 * t), 0, 0)), "stuck"),
    "half of a short run": (way(5, lambda t: (min(t, 2.2), 0, 0)), "stuck"),
    "less of a short run": (way(5, lambda t: (min(t, 4), 0, 0)), "out of time"),
    "leans a little": (way(20, standing, leaning(55, 3)), "stuck"),
    "leans": (way(20, standing, leaning(65, 3)), "tipped over"),
    "on its back": (way(20, standing, leaning(180, 3)), "tipped over"),
    # The first link of a robot may lie on its side in the robot.
    "its axis that was up": (way(20, standing, lambda _: rolled(90)), "stuck"),
    "no longer up": (way(20, standing, leaning(90, -1, 3)), "tipped over"),
    "stands again": (way(20, lambda t: (t, 0, 0), leaning(90, 5, 8)), "out of time"),
    "a step down": (falling(0.5, 5.0), "out of time"),
    "a metre at once": (falling(1.2, 5.0), "fell"),
    "for ever": (falling(30.0, 5.0), "fell"),
    "a slope": (way(20, lambda t: (t, 0, -0.9 * t)), "out of time"),
    "put down": (falling(1.5, 0.0), "out of time"),
    "came up again": (falling(1.5, 5.0, end=1.8), "out of time"),
}


@pytest.mark.parametrize(("trajectory", "word"), WORDS.values(), ids=WORDS.keys())
def test_the_word_for_a_failure(trajectory, word):
    assert kind(trajectory) == word


def test_the_first_word_that_is_true_wins():
    lying = way(20, lambda t: (0, 0, 0), lambda t: rolled(120 if t > 3 else 0))
    driving = way(20, lambda t: (min(t, 10), 0, 0))
    assert kind(lying, fell=True, arrived=9.0) == "fell"
    assert kind(lying, arrived=9.0) == "tipped over"
    assert kind(driving, arrived=10.0) == "lost"
    assert kind(driving) == "stuck"


def test_who_was_stuck_before_it_believed_to_be_there_is_not_lost():
    standing = way(20, lambda t: (min(t, 3), 0, 0))
    assert kind(standing, arrived=15.0) == "stuck"
    assert kind(standing, arrived=4.0) == "lost"
    assert kind(standing[:1]) == "stuck"
