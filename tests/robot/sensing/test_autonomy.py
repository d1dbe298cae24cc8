"""What a controller gets in a run: readings at their rates, an estimate, and never the truth."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ddenv.robot.clock import Clock
from ddenv.robot.protocol import Twist
from ddenv.robot.simulation.template import Template

NOISE = {"compass": 0.02, "gyro": 0.02, "odometry": 0.02}


class Listener:
    """Drives ahead in a slight bend, and keeps all readings."""

    def __init__(self, setup) -> None:
        self.setup = setup
        self.readings = []

    def step(self, reading):
        self.readings.append(reading)
        return Twist(0.6, 0.1)


def listen(world, robot, scenario, seed: int = 1):
    template = Template(world, robot, scenario)
    listeners = []

    def make(setup):
        listeners.append(Listener(setup))
        return listeners[-1]

    template._controllers = make
    result = template.run(frozenset(), seed)
    return listeners[-1], result


def test_each_sensor_measures_at_its_rate(world_of, husky, scenario_of):
    sensors = {"compass_rate": 5, "imu_rate": 20, "odometry_rate": 10, "lidar": {"rate": 4}}
    scenario = scenario_of(sensors=sensors, controller={"period": 0.05}, failure={"timeout": 2.0})
    heard, _ = listen(world_of(), husky, scenario)
    assert [round(reading.time / 0.05) for reading in heard.readings] == list(range(40))
    seen = {
        name: [number for number, reading in enumerate(heard.readings) if getattr(reading, name) is not None]
        for name in ("compass", "imu", "wheels", "scan")
    }
    every = {"compass": 4, "imu": 1, "wheels": 2, "scan": 5}
    assert seen == {name: list(range(0, 40, steps)) for name, steps in every.items()}
    assert all(reading.scan.time == reading.time for reading in heard.readings if reading.scan)


def test_measurements_between_two_commands_reach_the_next(world_of, husky, scenario_of):
    scenario = scenario_of(
        sensors={"compass_rate": 100 / 3, "imu_rate": 20, "odometry_rate": 20},
        controller={"period": 0.1},
        failure={"timeout": 1.0},
    )
    heard, _ = listen(world_of(), husky, scenario)
    assert all(reading.compass is not None for reading in heard.readings)


def test_the_estimate_is_near_the_truth_and_never_the_truth(world_of, husky, scenario_of):
    scenario = scenario_of(sensors=NOISE, goal={"x": 50, "y": 0}, failure={"timeout": 8.0})
    heard, result = listen(world_of(), husky, scenario)
    rows = {round(row[0], 6): row for row in result.trajectory}
    pairs = [(reading.estimate, rows[round(reading.time, 6)]) for reading in heard.readings[2::2]]
    gaps = [math.hypot(estimate.x - row[1], estimate.y - row[2]) for estimate, row in pairs]
    assert max(gaps) < 0.3
    assert min(gaps[5:]) > 0.0
    # Skidding wheels, seen by the odometry alone, would have it turn at twice the rate.
    assert pairs[-1][0].heading == pytest.approx(2 * math.atan2(pairs[-1][1][7], pairs[-1][1][4]), abs=0.1)


@pytest.mark.rates
def test_a_compass_that_points_wrong_leads_the_robot_astray(world_of, husky, scenario_of):
    sections = {"goal": {"x": 8, "y": 0, "tolerance": 0.6}, "failure": {"timeout": 20.0}}
    good = Template(world_of(), husky, scenario_of(sensors=NOISE, **sections))
    wrong = Template(world_of(), husky, scenario_of(sensors=NOISE | {"compass_bias": 0.5}, **sections))
    assert {good.run(frozenset(), seed).outcome for seed in range(4)} == {"pass"}
    results = [wrong.run(frozenset(), seed) for seed in range(4)]
    assert "lost" in {result.failure for result in results}


def test_wheels_that_slip_are_believed(world_of, husky, scenario_of):
    """On ice the wheels turn, the robot does not get on, and its odometry says that it does."""
    ice = (
        '<model name="ice"><static>true</static><pose>0 0 0.005 0 0 0</pose><link name="l"><collision name="c"><geometry><box>'
        "<size>4 4 0.01</size></box></geometry><surface><friction><ode><mu>0.001</mu></ode></friction></surface>"
        "</collision></link></model>"
    )
    scenario = scenario_of(
        robot={"model": "husky.sdf", "spawn": {"x": 0, "y": 0, "z": 0.15}},
        sensors=NOISE,
        goal={"x": 50, "y": 0},
        failure={"timeout": 5.0},
        protected=["ice"],
    )
    heard, result = listen(world_of(ice), husky, scenario)
    assert result.end_pose[0] < 0.5
    assert heard.readings[-1].estimate.x > 2.0


def test_the_setup_describes_the_robot(world_of, husky, scenario_of):
    scenario = scenario_of(controller={"speed": 0.7, "options": {"side": "left"}}, failure={"timeout": 0.2})
    heard, _ = listen(world_of(), husky, scenario, seed=9)
    setup = heard.setup
    assert (setup.goal, setup.tolerance, setup.start) == ((3.0, 0.0), 0.5, (0.0, 0.0, 0.0))
    assert (setup.radius, setup.track) == pytest.approx((0.1651, 0.5708))
    assert setup.footprint == pytest.approx((0.4937, 0.4937, 0.3426, 0.3426), abs=0.01)
    assert (setup.speed, setup.options, setup.seed) == (0.7, {"side": "left"}, 9)


def test_a_clock_counts_whole_steps(scenario_of):
    sensors = {"compass_rate": 7, "lidar": {"rate": 3}}
    scenario = scenario_of(
        sensors=sensors, failure={"timeout": 3.0}, simulation={"time_step": 0.01}, controller={"period": 0.03}
    )
    ticks = Clock.of(scenario).ticks
    steps = [tick.step for tick in ticks]
    assert steps == sorted(set(steps))
    assert (steps[0], steps[-1]) == (0, 300)
    for name, every in (("record", 10), ("command", 3), ("compass", 14), ("imu", 5), ("odometry", 5), ("lidar", 33)):
        assert [tick.step for tick in ticks if getattr(tick, name)] == list(range(0, 301, every)), name
    assert np.allclose([tick.time for tick in ticks], np.array(steps) * 0.01)
