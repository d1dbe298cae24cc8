"""In which way a robot failed."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.robot.oracle import kind_of
from ddenv.robot.simulation.run import ANGLE, RADIUS, SECONDS, Stuck


def way(seconds: float, place, turn=lambda t: (1.0, 0.0, 0.0, 0.0)) -> np.ndarray:
    """A trajectory with a row every 0.1 s: `place(t)` is x, y, z, `turn(t)` a quaternion."""
    times = np.arange(0.0, seconds + 0.05, 0.1)
    return np.array([(t, *place(t), *turn(t)) for t in times])


def rolled(degrees: float) -> tuple[float, ...]:
    half = math.radians(degrees) / 2
    return math.cos(half), math.sin(half), 0.0, 0.0


def kind(trajectory: np.ndarray, *, fell: bool = False, arrived: float | None = None) -> str:
    return kind_of(trajectory, fell, arrived)


@pytest.mark.parametrize(
    ("still", "word"), [(10.0, "stuck"), (6.5, "stuck"), (4.0, "out of time"), (0.0, "out of time")]
)
def test_who_stood_still_at_the_end_is_stuck(still, word):
    assert kind(way(30, lambda t: (min(t, 30 - still), 0, 0))) == word


def test_who_goes_back_and_forth_in_a_corner_is_stuck():
    assert kind(way(30, lambda t: (0.2 * math.sin(2 * t), 0, 0))) == "stuck"


def test_of_a_short_run_half_is_enough():
    assert kind(way(5, lambda t: (min(t, 2.2), 0, 0))) == "stuck"
    assert kind(way(5, lambda t: (min(t, 4), 0, 0))) == "out of time"


@pytest.mark.parametrize(("degrees", "word"), [(0, "stuck"), (55, "stuck"), (65, "tipped over"), (180, "tipped over")])
def test_who_leans_at_the_end_has_tipped_over(degrees, word):
    assert kind(way(20, lambda t: (0, 0, 0), lambda t: rolled(degrees if t > 3 else 0))) == word


def test_the_axis_that_was_up_at_the_start_counts():
    """The first link of a robot may lie on its side in the robot."""
    assert kind(way(20, lambda t: (0, 0, 0), lambda _: rolled(90))) == "stuck"
    assert kind(way(20, lambda t: (0, 0, 0), lambda t: rolled(90 if t < 3 else 0))) == "tipped over"


def test_who_came_to_stand_again_has_not_tipped_over():
    assert kind(way(20, lambda t: (t, 0, 0), lambda t: rolled(90 if 5 < t < 8 else 0))) == "out of time"


def falling(deep: float, start: float, seconds: float = 20.0) -> np.ndarray:
    """Falls freely from `start` s on until it lies `deep` m lower."""
    return way(seconds, lambda t: (t, 0, 2 - min(deep, 4.9 * max(0.0, t - start) ** 2)))


@pytest.mark.parametrize(("deep", "word"), [(0.5, "out of time"), (1.2, "fell"), (2.0, "fell"), (30.0, "fell")])
def test_who_dropped_a_metre_at_once_fell(deep, word):
    assert kind(falling(deep, 5.0)) == word


def test_a_slope_is_no_fall_and_neither_is_being_put_down():
    assert kind(way(20, lambda t: (t, 0, -0.9 * t))) == "out of time"
    assert kind(falling(1.5, 0.0)) == "out of time"


def test_who_came_up_again_did_not_fall():
    trajectory = falling(1.5, 5.0)
    trajectory[-1, 3] = 1.8
    assert kind(trajectory) == "out of time"


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


@given(start=st.floats(0, 40), x=st.floats(-RADIUS / 3, RADIUS / 3), degrees=st.floats(-1, 1), rate=st.floats(0.5, 9))
def test_a_run_that_was_cut_is_stuck(start, x, degrees, rate):
    """A robot that drove `start` s and then rocks in a rut is cut 8 s after that, and its kind says the same."""
    period = 2 * math.pi / rate
    trajectory = way(
        start + SECONDS + period + 1,
        lambda t: (min(t, start) + x * math.sin(rate * t), 0, 0),
        lambda t: rolled(degrees * math.sin(rate * t)),
    )
    stuck = Stuck()
    cut = next(row for row, values in enumerate(trajectory) if stuck.update(values[0], tuple(values[1:])))
    assert start - 0.3 <= trajectory[cut, 0] - SECONDS <= start + period + 0.3
    assert kind(trajectory[: cut + 1]) == "stuck"


@pytest.mark.parametrize(
    ("place", "turn"),
    [
        (lambda t: (1.5 * RADIUS / SECONDS * t, 0, 0), lambda _: rolled(0)),
        (lambda t: (0, 0, 0), lambda t: rolled(math.degrees(1.5 * ANGLE / SECONDS * t))),
        # Waits for 7 s, backs up for a moment, and so on.
        (lambda t: (0.2 * (t // 7 % 2), 0, 0), lambda _: rolled(0)),
    ],
    ids=["creeping", "turning", "trying again"],
)
def test_who_still_moves_is_not_stuck_yet(place, turn):
    stuck = Stuck()
    assert not any(stuck.update(values[0], tuple(values[1:])) for values in way(60, place, turn))
