"""Fusing compass, gyro and odometry into a pose."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ddenv.robot.estimate import Estimate, advance, wrap
from ddenv.robot.sensors import Measurement, SensorSuite, Truth
from ddenv.world.scenario import Sensors

NOISELESS = Sensors(compass=0, gyro=0, odometry=0)
DT = 0.05
moves = st.lists(st.tuples(st.floats(-1, 1), st.floats(-2, 2)), min_size=1, max_size=200)


def drive(moves, noise: Sensors, seed: int = 0):
    """Truth and estimate after arcs of (speed m/s, turn rate rad/s), each held for DT."""
    sensors = SensorSuite(noise, seed)
    x = y = heading = 0.0
    estimate = Estimate(0.0, 0.0, 0.0)
    for speed, rate in moves:
        x += speed * DT * math.cos(heading + rate * DT / 2)
        y += speed * DT * math.sin(heading + rate * DT / 2)
        heading = wrap(heading + rate * DT)
        estimate = advance(estimate, sensors.measure(Truth(x, y, heading, rate, speed, speed)), noise, DT)
    return Truth(x, y, heading, 0.0, 0.0, 0.0), estimate


@given(moves)
@settings(max_examples=100, deadline=None)
def test_without_noise_the_estimate_is_the_truth(moves):
    truth, estimate = drive(moves, NOISELESS)
    assert math.hypot(truth.x - estimate.x, truth.y - estimate.y) < 1e-6
    assert abs(wrap(truth.heading - estimate.heading)) < 1e-6


def test_fusing_beats_the_compass_and_the_gyro_alone():
    noise = Sensors(compass=0.1, gyro=0.02, gyro_bias=0.02, odometry=0)
    moves = [(0.5, 0.3)] * 1200
    # 60 s with a gyro bias of 0.02 rad/s would be off by 1.2 rad, a compass by 0.1.
    errors = [
        wrap(truth.heading - estimate.heading) for truth, estimate in (drive(moves, noise, seed) for seed in range(20))
    ]
    assert float(np.sqrt(np.mean(np.square(errors)))) < 0.06


def test_a_wrong_start_is_corrected_by_the_compass():
    estimate = Estimate(0.0, 0.0, 1.0)
    for _ in range(400):
        estimate = advance(estimate, Measurement(0.0, 0.0, 0.0, 0.0), Sensors(compass=0.05, gyro=0.05), DT)
    assert abs(estimate.heading) < 0.01


@given(st.floats(-100, 100))
def test_wrapping_keeps_the_direction(angle):
    assert -math.pi <= wrap(angle) <= math.pi
    assert math.cos(wrap(angle)) == pytest.approx(math.cos(angle), abs=1e-9)
    assert math.sin(wrap(angle)) == pytest.approx(math.sin(angle), abs=1e-9)


def test_heading_is_fused_across_the_jump_from_pi_to_minus_pi():
    estimate = Estimate(0.0, 0.0, math.pi - 0.01)
    after = advance(estimate, Measurement(-math.pi + 0.01, 0.4, 0.0, 0.0), Sensors(), DT)
    assert abs(wrap(after.heading - math.pi)) < 0.02


def test_sensor_noise_has_the_spread_that_the_scenario_says():
    noise = Sensors(compass=0.03, gyro=0.2, odometry=0.1)
    sensors = SensorSuite(noise, seed=3)
    truth = Truth(0.0, 0.0, 0.5, 0.2, 1.0, 2.0)
    readings = [sensors.measure(truth) for _ in range(4000)]
    spread = np.std([(r.heading, r.yaw_rate, r.left, r.right) for r in readings], axis=0)
    mean = np.mean([(r.heading, r.yaw_rate, r.left, r.right) for r in readings], axis=0)
    assert spread == pytest.approx([0.03, 0.2, 0.1, 0.2], rel=0.1)
    assert mean == pytest.approx([0.5, 0.2, 1.0, 2.0], abs=0.02)


def test_a_bias_is_drawn_once_in_a_run():
    noise = Sensors(compass=0, compass_bias=0.1, gyro=0, odometry=0)
    truth = Truth(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    biases = []
    for seed in range(300):
        sensors = SensorSuite(noise, seed)
        headings = {sensors.measure(truth).heading for _ in range(5)}
        assert len(headings) == 1
        biases.append(headings.pop())
    assert float(np.std(biases)) == pytest.approx(0.1, rel=0.15)
