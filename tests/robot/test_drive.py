"""Which wheels a robot has, and how they turn it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from ddenv.errors import UserError
from ddenv.robot.drive import find_drive
from ddenv.robot.estimate import Estimate
from ddenv.robot.navigate import STOP, Command, Navigator
from ddenv.world.scenario import Controller, Goal


def test_the_husky_has_four_wheels(husky):
    drive = find_drive(husky)
    assert drive.joints == ("front_left_wheel", "front_right_wheel", "rear_left_wheel", "rear_right_wheel")
    assert drive.left == (True, False, True, False)
    assert drive.radius == pytest.approx(0.1651)
    assert drive.track == pytest.approx(0.5708)


def test_wheel_speeds_of_a_skid_steered_turn(husky):
    drive = find_drive(husky)
    assert drive.wheel_speeds(Command(1.0, 0.0), 0.5) == pytest.approx(np.full(4, 1.0 / 0.1651))
    left, right, *_ = drive.wheel_speeds(Command(0.0, 1.0), 0.5) * 0.1651
    # To turn at 1 rad/s where half of it is lost, the rims must differ by 2 rad/s times the track.
    assert right - left == pytest.approx(2 * 0.5708)
    assert right > 0 > left


def test_a_robot_without_wheels_is_refused(husky):
    with pytest.raises(UserError, match=r"husky.*wheels"):
        find_drive(replace(husky, joints=()))


def test_a_robot_with_wheels_on_one_side_is_refused(husky):
    with pytest.raises(UserError, match="left and right"):
        find_drive(replace(husky, joints=husky.joints[::2]))


def test_starts_gently_and_keeps_to_its_speed():
    navigator = Navigator(Goal(x=10, y=0), Controller(speed=0.5, acceleration=1.0, period=0.1))
    speeds = [navigator.command(Estimate(0.0, 0.0, 0.0)).speed for _ in range(8)]
    assert speeds == pytest.approx([0.1, 0.2, 0.3, 0.4, 0.5, 0.5, 0.5, 0.5])


def test_turns_on_the_spot_to_a_goal_behind():
    command = Navigator(Goal(x=-10, y=1), Controller(turn_rate=0.7)).command(Estimate(0.0, 0.0, 0.0))
    assert command.speed == 0.0
    assert command.turn_rate == pytest.approx(0.7)


def test_stays_once_it_believes_to_be_there():
    navigator = Navigator(Goal(x=10, y=0, tolerance=1.0), Controller())
    assert navigator.command(Estimate(9.7, 0.0, 0.0)) != STOP
    assert navigator.command(Estimate(9.9, 0.0, 0.0)) == STOP
    assert navigator.command(Estimate(5.0, 0.0, 0.0)) == STOP
