"""Noise: as large as the scenario says, and the same for the same seed."""

from __future__ import annotations

import numpy as np
import pytest

from ddenv.robot.sensing.autonomy import SensorSuite, Truth
from ddenv.world.scenario import Sensors

TRUTH = Truth(0.5, 0.01, -0.02, 0.2, (1.0, 2.0))


def readings(noise: Sensors, seed: int, count: int) -> np.ndarray:
    """Compass, yaw rate, roll, pitch, left and right wheel, shape (count, 6)."""
    sensors = SensorSuite(noise, seed)
    rows = []
    for _ in range(count):
        imu = sensors.imu(TRUTH)
        rows.append((sensors.compass(TRUTH), imu.yaw_rate, imu.roll, imu.pitch, *sensors.odometry(TRUTH.wheels)))
    return np.array(rows)


def test_noise_has_the_spread_that_the_scenario_says():
    rows = readings(Sensors(compass=0.03, gyro=0.2, tilt=0.01, odometry=0.1), 3, 4000)
    assert rows.std(axis=0) == pytest.approx([0.03, 0.2, 0.01, 0.01, 0.1, 0.2], rel=0.1)
    assert rows.mean(axis=0) == pytest.approx([0.5, 0.2, 0.01, -0.02, 1.0, 2.0], abs=0.02)


def test_a_bias_is_drawn_once_in_a_run():
    noise = Sensors(
        compass=0, compass_bias=0.1, gyro=0, gyro_bias=0.2, odometry=0, odometry_bias=0.05, tilt=0, imu_rate=20
    )
    first = []
    for seed in range(300):
        rows = readings(noise, seed, 5)
        assert (rows == rows[0]).all()
        first.append(rows[0])
    assert np.std(first, axis=0) == pytest.approx([0.1, 0.2, 0, 0, 0.05, 0.1], rel=0.15)


def test_a_sensor_does_not_change_the_noise_of_another():
    alone, among = SensorSuite(Sensors(), 7), SensorSuite(Sensors(), 7)
    for _ in range(3):
        among.imu(TRUTH)
        among.odometry(TRUTH.wheels)
        among.lidar.standard_normal(541)
    assert among.compass(TRUTH) == alone.compass(TRUTH)
