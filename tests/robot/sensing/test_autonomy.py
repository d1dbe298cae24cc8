"""What a controller gets in a run: readings with noise at their rates, an estimate, and never the
truth.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from ddenv.robot.clock import Clock
from ddenv.robot.protocol import Twist
from ddenv.robot.sensing import autonomy as filter_module
from ddenv.robot.sensing.autonomy import Filter, SensorSuite, Truth
from ddenv.robot.simulation.plant_cache import Plant
from ddenv.world.pose import wrap
from ddenv.world.scenario import Sensors

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
    template = Plant(world, robot, scenario)
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
        name: [
            number
            for number, reading in enumerate(heard.readings)
            if getattr(reading, name) is not None
        ]
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
    assert pairs[-1][0].heading == pytest.approx(
        2 * math.atan2(pairs[-1][1][7], pairs[-1][1][4]), abs=0.1
    )


@pytest.mark.rates
def test_a_compass_that_points_wrong_leads_the_robot_astray(world_of, husky, scenario_of):
    sections = {"goal": {"x": 8, "y": 0, "tolerance": 0.6}, "failure": {"timeout": 20.0}}
    good = Plant(world_of(), husky, scenario_of(sensors=NOISE, **sections))
    wrong = Plant(world_of(), husky, scenario_of(sensors=NOISE | {"compass_bias": 0.5}, **sections))
    assert {good.run(frozenset(), seed).outcome for seed in range(4)} == {"pass"}
    results = [wrong.run(frozenset(), seed) for seed in range(4)]
    assert "lost" in {result.failure for result in results}


def test_wheels_that_slip_are_believed(world_of, husky, scenario_of):
    """On ice the wheels turn, the robot does not get on, and its odometry says that it does."""
    ice = (
        '<model name="ice"><static>true</static><pose>0 0 0.005 0 0 0</pose><link '
        'name="l"><collision name="c"><geometry><box>'
        "<size>4 4 "
        "0.01</size></box></geometry><surface><friction><ode><mu>0.001</mu></ode></friction></surface>"
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
    scenario = scenario_of(
        controller={"speed": 0.7, "options": {"side": "left"}}, failure={"timeout": 0.2}
    )
    heard, _ = listen(world_of(), husky, scenario, seed=9)
    setup = heard.setup
    assert (setup.goal, setup.tolerance, setup.start) == ((3.0, 0.0), 0.5, (0.0, 0.0, 0.0))
    assert (setup.radius, setup.track) == pytest.approx((0.1651, 0.5708))
    assert setup.footprint == pytest.approx((0.4937, 0.4937, 0.3426, 0.3426), abs=0.01)
    assert (setup.speed, setup.options, setup.seed) == (0.7, {"side": "left"}, 9)


def test_a_clock_counts_whole_steps(scenario_of):
    sensors = {"compass_rate": 7, "lidar": {"rate": 3}}
    scenario = scenario_of(
        sensors=sensors,
        failure={"timeout": 3.0},
        simulation={"time_step": 0.01},
        controller={"period": 0.03},
    )
    ticks = Clock.of(scenario).ticks
    steps = [tick.step for tick in ticks]
    assert steps == sorted(set(steps))
    assert (steps[0], steps[-1]) == (0, 300)
    for name, every in (
        ("record", 10),
        ("command", 3),
        ("compass", 14),
        ("imu", 5),
        ("odometry", 5),
        ("lidar", 33),
    ):
        assert [tick.step for tick in ticks if getattr(tick, name)] == list(range(0, 301, every)), (
            name
        )
    assert np.allclose([tick.time for tick in ticks], np.array(steps) * 0.01)


NOISELESS = Sensors(compass=0, gyro=0, odometry=0, tilt=0)
DT = 0.05
RADIUS, TRACK = 0.1651, 0.5708
moves = st.lists(st.tuples(st.floats(-1, 1), st.floats(-2, 2)), min_size=1, max_size=200)


def wheels(speed: float, rate: float) -> tuple[float, float]:
    """Angular speeds of a left and a right wheel that do not slip."""
    return (speed - rate * TRACK / 2) / RADIUS, (speed + rate * TRACK / 2) / RADIUS


def drive(moves, noise: Sensors, seed: int = 0, slip: float = 1.0):
    """The true pose and the filter after arcs of (speed m/s, turn rate rad/s), each held for DT; a
    compass every second time.

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
    st.lists(
        st.tuples(*[st.floats(-1, 1)] * 4, st.none() | st.floats(-3, 3)), min_size=1, max_size=40
    ),
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


TRUTH = Truth(0.5, 0.01, -0.02, 0.2, (1.0, 2.0))


def readings(noise: Sensors, seed: int, count: int) -> np.ndarray:
    """Compass, yaw rate, roll, pitch, left and right wheel, shape (count, 6)."""
    sensors = SensorSuite(noise, seed)
    rows = []
    for _ in range(count):
        imu = sensors.imu(TRUTH)
        rows.append(
            (
                sensors.compass(TRUTH),
                imu.yaw_rate,
                imu.roll,
                imu.pitch,
                *sensors.odometry(TRUTH.wheels),
            )
        )
    return np.array(rows)


def test_noise_has_the_spread_that_the_scenario_says():
    rows = readings(Sensors(compass=0.03, gyro=0.2, tilt=0.01, odometry=0.1), 3, 4000)
    assert rows.std(axis=0) == pytest.approx([0.03, 0.2, 0.01, 0.01, 0.1, 0.2], rel=0.1)
    assert rows.mean(axis=0) == pytest.approx([0.5, 0.2, 0.01, -0.02, 1.0, 2.0], abs=0.02)


def test_a_bias_is_drawn_once_in_a_run():
    noise = Sensors(
        compass=0,
        compass_bias=0.1,
        gyro=0,
        gyro_bias=0.2,
        odometry=0,
        odometry_bias=0.05,
        tilt=0,
        imu_rate=20,
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
