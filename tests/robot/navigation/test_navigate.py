"""Drives of a robot without weight among circles and walls."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ddenv.robot.protocol import STOP
from tests.robot.navigation.toy import PERIOD, Drive, Ground, drive, setup

GAP = Ground(walls=((4, -8, 4, -0.55), (4, 0.55, 4, 8)))
SHUT_IN = Ground(walls=((-2, -2, 2, -2), (2, -2, 2, 2), (2, 2, -2, 2), (-2, 2, -2, -2)))


def is_there(drove: Drive, goal: tuple[float, float], tolerance: float = 0.5) -> bool:
    return drove.navigator.arrived and math.dist(drove.poses[-1][:2], goal) <= tolerance


@pytest.mark.parametrize("blind", [False, True], ids=["lidar", "blind"])
def test_straight_to_the_goal_in_the_open(blind):
    drove = drive(setup((8, 3)), Ground(), start=(0, 0, math.atan2(3, 8)), blind=blind)
    assert is_there(drove, (8, 3))
    assert drove.times[-1] < 11
    assert max(abs(twist.turn_rate) for twist in drove.twists) < 0.05


def test_turns_to_a_goal_behind():
    assert is_there(drive(setup((-5, 0.5)), Ground()), (-5, 0.5))


@pytest.mark.parametrize("seed", [0, 1])
def test_among_barrels_within_its_limits(seed):
    ground = Ground(
        circles=tuple((2 + 1.7 * n, (-1) ** (n + seed) * 0.4 * (n % 3), 0.3) for n in range(6))
    )
    given = setup((14, 0), speed=0.8, acceleration=0.6, turn_rate=0.7)
    drove = drive(given, ground, seed=seed)
    assert is_there(drove, (14, 0))
    assert min(drove.rooms(ground)) > 0.03
    speeds = np.array([0.0, *(twist.speed for twist in drove.twists)])
    assert speeds.max() <= 0.8
    assert np.diff(speeds).max() <= 0.6 * PERIOD + 1e-9
    assert max(abs(twist.turn_rate) for twist in drove.twists) <= 0.7 + 1e-9


@pytest.mark.parametrize(
    "start",
    [(0, 0, 0), (0, 1.5, 0), (0, -3, 0), (2.5, 2, -1)],
    ids=["ahead", "beside", "far beside", "near"],
)
def test_straight_through_a_gap(start):
    drove = drive(setup((8, 0)), GAP, start=start)
    assert is_there(drove, (8, 0))
    assert drove.times[-1] < 14
    inside = [
        (pose, twist)
        for pose, twist in zip(drove.poses, drove.twists, strict=True)
        if abs(pose[0] - 4) < 0.5
    ]
    assert max(abs(pose[1]) for pose, _ in inside) < 0.1
    assert max(abs(pose[2]) for pose, _ in inside) < 0.15
    assert min(twist.speed for _, twist in inside) > 0.3
    turns = np.array([twist.turn_rate for _, twist in inside])
    assert np.abs(np.diff(turns)).max() < 0.15
    assert min(drove.rooms(GAP)) > 0.1


@pytest.mark.parametrize("angle", [0.3, 0.6, 1.1])
def test_through_a_gap_that_is_askew_of_the_map(angle):
    cosine, sine = math.cos(angle), math.sin(angle)

    def turned(x: float, y: float) -> tuple[float, float]:
        return cosine * x - sine * y, sine * x + cosine * y

    # As deep as the robot is long.
    sides = ((4, -6, 4, -0.55), (4, 0.55, 4, 6), (4, -0.55, 5, -0.55), (4, 0.55, 5, 0.55))
    ground = Ground(walls=tuple((*turned(ax, ay), *turned(bx, by)) for ax, ay, bx, by in sides))
    drove = drive(setup(turned(8, 0)), ground, start=(0, 0, angle))
    assert is_there(drove, turned(8, 0))
    assert min(drove.rooms(ground)) > 0.03


def test_around_a_gap_that_is_too_narrow():
    ground = Ground(walls=((4, -3, 4, -0.35), (4, 0.35, 4, 3)))
    drove = drive(setup((8, 0)), ground)
    assert is_there(drove, (8, 0))
    assert min(drove.rooms(ground)) > 0.03
    assert max(abs(y) for _, y, _ in drove.poses) > 3


def test_gives_up_when_it_is_shut_in():
    drove = drive(setup((8, 0)), SHUT_IN, until=90)
    assert drove.navigator.gave_up
    assert not drove.navigator.arrived
    assert drove.twists[-1] == STOP
    assert min(drove.rooms(SHUT_IN)) > 0.03


def test_gives_up_at_once_where_it_may_not_try():
    drove = drive(setup((8, 0), planner={"recoveries": 0}), SHUT_IN, until=10)
    assert drove.navigator.gave_up
    assert drove.times[-1] < 3


def test_goes_on_after_slipping():
    drove = drive(setup((8, 0)), Ground(), slips=lambda time: 3 < time < 13)
    assert is_there(drove, (8, 0))
    slipping = [
        twist for time, twist in zip(drove.times, drove.twists, strict=True) if 3 < time < 13
    ]
    assert any(twist.speed < 0 for twist in slipping), "it tries to get free backwards"


def test_goes_on_when_an_obstacle_went_away():
    closed = Ground(walls=((4, -30, 4, 30),))
    drove = drive(setup((8, 0)), lambda time: closed if time < 6 else Ground(), until=40)
    assert is_there(drove, (8, 0))
