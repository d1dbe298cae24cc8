"""Between the rows of a recording, things move and turn evenly."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.world.pose import pose_at


def turn(yaw: float) -> list[float]:
    return [math.cos(yaw / 2), 0.0, 0.0, math.sin(yaw / 2)]


def test_poses_between_rows():
    rows = np.array([[0.0, 0, 0, 0, *turn(0.0)], [2.0, 4, 0, 0, *(-part for part in turn(1.0))]])
    assert pose_at(rows, 1.0).position == pytest.approx((2, 0, 0))
    assert pose_at(rows, 1.0).yaw() == pytest.approx(0.5)
    assert pose_at(rows, -1.0).position == pytest.approx((0, 0, 0))
    assert pose_at(rows, 9.0).position == pytest.approx((4, 0, 0))
    assert pose_at(rows[:1], 1.0).position == (0, 0, 0)


@given(st.lists(st.floats(-10, 10), min_size=4, max_size=4), st.floats(0, 1))
def test_rotations_stay_of_unit_length(quaternion, part):
    rows = np.array([[0.0, 0, 0, 0, *turn(0.3)], [1.0, 0, 0, 0, *quaternion]])
    length = math.hypot(*pose_at(rows, part).quaternion)
    assert length == pytest.approx(1.0) or length == 0.0
