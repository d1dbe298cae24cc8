"""Fusing odometry, gyro and compass into a pose."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.robot.sensing import autonomy as filter_module
from ddenv.robot.sensing.autonomy import Filter, SensorSuite, Truth
from ddenv.world.pose import wrap
from ddenv.world.scenario import Sensors

NOISELESS = Sensors(compass=0, gyro=0, odometry=0, tilt=0)
DT = 0.05
RADIUS, TRACK = 0.1651, 0.5708
moves = st.lists(st.tuples(st.floats(-1, 1), st.floats(-2, 2)), min_size=1, max_size=200)


def wheels(speed: float, rate: float) -> tuple[float, float]:
    """Angular speeds of a left and a right wheel that do not slip."""
    return (speed - rate * TRACK / 2) / RADIUS, (speed + rate * TRACK / 2) / RADIUS


def drive(moves, noise: Sensors, seed: int = 0, slip: float = 1.0):
    """The true pose and the filter after arcs of (speed m/s, turn rate rad/s), each held for DT; a compass every second time.

    The robot goes only `slip` of what its wheels say.
    """
    sensors = SensorSuite(noise, seed)
    x = y = heading = 0.0
    filter = Filter(x, y, heading, noise)
    for number, (speed, rate) in enumerate(moves):
        middle = heading + rate * DT / 2
        x += slip * speed * DT * math.cos(middle)
        y += slip * speed * DT * math.sin(middle)
        heading = wrap(heading + rate * DT)
        truth = Truth(heading, 0.0, 0.0, rate, wheels(speed, rate))
        left, right = (RADIUS * each for each in sensors.odometry(truth.wheels))
        imu = sensors.imu(truth)
        filter.advance((left + right) / 2, (right - left) / TRACK, imu.yaw_rate, imu.pitch, DT)
        if number % 2:
            filter.correct(sensors.compass(truth))
    return (x, y, heading), filter.estimate


@given(moves)
def test_without_noise_the_estimate_is_the_truth(moves):
    (x, y, heading), estimate = drive(moves, NOISELESS)
    assert math.hypot(x - estimate.x, y - estimate.y) < 1e-6
    assert abs(wrap(heading - estimate.heading)) < 1e-6
    assert (estimate.speed, estimate.turn_rate) == pytest.approx(moves[-1], abs=1e-6)


class Matrices:
    """The same filter as matrices of a textbook."""

    def __init__(self, sensors: Sensors) -> None:
        self.state = np.zeros(4)
        self.covariance = np.diag([0.0, 0.0, 0.0, sensors.gyro_bias**2])
        self.gyro = sensors.gyro**2 + filter_module.SMALLEST**2
        self.compass = sensors.compass**2 + filter_module.SMALLEST**2

    def advance(self, speed, wheel_rate, gyro_rate, pitch, dt):
        trust = filter_module.SKIDDING**2 / (filter_module.SKIDDING**2 + self.gyro)
        rate = trust * (gyro_rate - self.state[3]) + (1 - trust) * wheel_rate
        way, middle = speed * math.cos(pitch) * dt, self.state[2] + rate * dt / 2
        jacobian = np.eye(4)
        jacobian[0, 2], jacobian[1, 2] = -way * math.sin(middle), way * math.cos(middle)
        jacobian[:2, 3] = jacobian[:2, 2] * -trust * dt / 2
        jacobian[2, 3] = -trust * dt
        along = np.array([math.cos(middle), math.sin(middle), 0, 0]) * filter_module.SLIPPING * way
        noise = np.outer(along, along)
        rate_noise = self.gyro * filter_module.SKIDDING**2 / (self.gyro + filter_module.SKIDDING**2)
        noise[2, 2] += rate_noise * dt**2 + filter_module.UNSEEN**2 * dt
        self.state[:3] += [way * math.cos(middle), way * math.sin(middle), rate * dt]
        self.covariance = jacobian @ self.covariance @ jacobian.T + noise

    def correct(self, compass):
        gain = self.covariance[:, 2] / (self.covariance[2, 2] + self.compass)
        self.state += gain * wrap(compass - self.state[2])
        self.covariance = self.covariance - np.outer(gain, self.covariance[2])


@given(
    st.lists(st.tuples(*[st.floats(-1, 1)] * 4, st.none() | st.floats(-3, 3)), min_size=1, max_size=40),
    st.floats(0, 0.2),
    st.floats(0.001, 0.2),
)
def test_its_scalars_are_the_textbooks_matrices(steps, bias, spread):
    sensors = Sensors(compass=spread, gyro=spread / 2, gyro_bias=bias)
    ours, theirs = Filter(0.0, 0.0, 0.0, sensors), Matrices(sensors)
    for speed, wheel_rate, gyro_rate, pitch, compass in steps:
        for filter in (ours, theirs):
            filter.advance(speed, wheel_rate, gyro_rate, pitch, DT)
            if compass is not None:
                filter.correct(compass)
    estimate = ours.estimate
    assert (estimate.x, estimate.y) == pytest.approx(theirs.state[:2], abs=1e-9)
    assert abs(wrap(estimate.heading - theirs.state[2])) < 1e-9
    spread = np.sqrt(np.maximum(np.diag(theirs.covariance)[:3], 0.0))
    assert np.square(estimate.spread) == pytest.approx(np.square(spread), abs=1e-9)


def test_what_it_says_of_its_errors_is_true():
    noise = Sensors(compass=0.05, gyro=0.02, gyro_bias=0.01, odometry=0.05)
    normalised = []
    for seed in range(60):
        (_, _, heading), estimate = drive([(0.5, 0.2)] * 400, noise, seed)
        normalised.append(wrap(heading - estimate.heading) / estimate.spread[2])
    assert 0.5 < float(np.std(normalised)) < 1.5


@given(st.floats(-100, 100))
def test_wrapping_keeps_the_direction(angle):
    assert -math.pi <= wrap(angle) <= math.pi
    assert math.cos(wrap(angle)) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrap(angle)) == pytest.approx(math.sin(angle), abs=1e-9)
