"""What the robot remembers of what its lidar saw."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ddenv.robot.navigation.costmap import Costmap
from ddenv.robot.protocol import Estimate, Imu, Scan
from tests.robot.navigation.toy import ANGLES, LIDAR, Ground, setup

BARREL = Ground(circles=((3.0, 1.0, 0.3),))
AT_START = Estimate(0.0, 0.0, 0.0)


def look(ground: Ground, at: Estimate) -> Scan:
    eye = at.x + LIDAR[0] * math.cos(at.heading), at.y + LIDAR[0] * math.sin(at.heading)
    return Scan(0.0, ANGLES, ground.ranges(*eye, at.heading), LIDAR)


def to_barrel(points: np.ndarray) -> np.ndarray:
    return np.hypot(points[:, 0] - 3.0, points[:, 1] - 1.0)


def test_noise_makes_no_other_map():
    costmap, random = Costmap(setup((9, 0))), np.random.default_rng(0)
    for number in range(30):
        taken = look(BARREL, AT_START)
        noise = 0.02 * random.standard_normal(len(ANGLES))
        costmap.see(Scan(0.0, ANGLES, taken.ranges + noise, LIDAR), AT_START)
        assert costmap.version == 1, number
    two = Ground(circles=(*BARREL.circles, (3.0, -1.0, 0.3)))
    costmap.see(look(two, AT_START), AT_START)
    assert costmap.version == 2


def test_what_is_out_of_sight_is_kept():
    costmap = Costmap(setup((9, 0)))
    costmap.see(look(BARREL, AT_START), AT_START)
    seen = costmap.points
    # The barrel is now behind the robot, where no beam goes.
    turned = Estimate(0.0, 0.0, math.pi + math.atan2(1, 3))
    costmap.see(look(Ground(), turned), turned)
    assert costmap.points == pytest.approx(seen)


def test_ground_that_a_tilted_robot_sees_is_no_obstacle():
    # Nose down by 0.1 rad, the beams meet the ground some 5 m ahead.
    ahead = np.full(len(ANGLES), np.inf)
    ahead[abs(ANGLES) < 0.1] = 5.0
    scan = Scan(0.0, ANGLES, ahead, LIDAR)
    tilted, level = Costmap(setup((9, 0))), Costmap(setup((9, 0)))
    tilted.see(scan, AT_START, Imu(0.0, 0.0, 0.1))
    level.see(scan, AT_START, Imu(0.0, 0.0, 0.0))
    assert not len(tilted.points)
    assert len(level.points)


def test_forgets_what_is_far_and_less_of_what_is_out_of_sight():
    costmap = Costmap(setup((9, 0)))
    ground = Ground(circles=((1.5, 0.0, 0.2), (4.0, 2.0, 0.2)))
    costmap.see(look(ground, AT_START), AT_START)
    costmap.forget(AT_START, 2.0, 2.0)
    assert len(costmap.points)
    assert (np.hypot(*costmap.points.T) <= 2.0).all()
    costmap.forget(Estimate(0.0, 0.0, math.pi), 0.0, 2.0)
    assert len(costmap.points), "it is behind the robot"
    costmap.forget(AT_START, 0.0, 2.0)
    assert not len(costmap.points)
