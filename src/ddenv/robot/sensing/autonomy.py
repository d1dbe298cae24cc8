"""The robot's own side of a run: its sensors, its pose estimate, and the commands of its
controller.

Sensors are compass, IMU and wheel odometry, each with its own noise. The estimate is an extended
Kalman filter on these three.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from ddenv.robot.clock import Clock, Tick
from ddenv.robot.controllers import Listener
from ddenv.robot.protocol import Drives, Estimate, Imu, Reading, Scan, Setup, Twist, WheelSpeeds
from ddenv.text import Data
from ddenv.world.drive import Drive, footprint
from ddenv.world.model import Model
from ddenv.world.pose import wrap
from ddenv.world.scenario import Scenario, Sensors

# Random numbers drawn at once: drawing them one at a time would cost more than all that is done
# with them.
DRAWN = 256


class Truth(NamedTuple):
    """The robot's true heading, roll and pitch (rad, world frame), and turn rate about its own
    vertical axis (rad/s).

    `wheels` (rad/s) are the wheels' speeds, positive forward.
    """

    heading: float
    roll: float
    pitch: float
    yaw_rate: float
    wheels: tuple[float, ...]


def noise(random: np.random.Generator) -> Iterator[float]:
    """A stream of standard normal numbers."""
    while True:
        yield from reversed(random.standard_normal(DRAWN).tolist())


class SensorSuite:
    """The noisy sensors of one run. The same seed gives the same noise; each sensor has its own
    stream, whatever others measure.

    `lidar` is the random generator for the lidar's noise.
    """

    def __init__(self, settings: Sensors, seed: int) -> None:
        self._settings = settings
        *own, self.lidar = (
            np.random.default_rng(each) for each in np.random.SeedSequence(seed).spawn(4)
        )
        self._compass, self._imu, self._odometry = (noise(random) for random in own)
        # Drawn first, once a run: the compass's misalignment, the gyro's drift, the wear of the
        # tyres.
        self._heading_bias = settings.compass_bias * next(self._compass)
        self._rate_bias = settings.gyro_bias * next(self._imu)
        self._scale = 1.0 + settings.odometry_bias * next(self._odometry)

    def compass(self, truth: Truth) -> float:
        """The measured heading, rad."""
        return truth.heading + self._heading_bias + self._settings.compass * next(self._compass)

    def imu(self, truth: Truth) -> Imu:
        """The measured turn rate, roll and pitch."""
        settings = self._settings
        noise = self._imu
        return Imu(
            yaw_rate=truth.yaw_rate + self._rate_bias + settings.gyro * next(noise),
            roll=truth.roll + settings.tilt * next(noise),
            pitch=truth.pitch + settings.tilt * next(noise),
        )

    def odometry(self, wheels: Sequence[float]) -> tuple[float, ...]:
        """The measured speeds of the wheels, rad/s; a wheel that slips is not distinguished from
        one that grips.
        """
        scale = self._scale
        spread = self._settings.odometry
        noise = self._odometry
        return tuple([speed * (scale + spread * next(noise)) for speed in wheels])


# The standard deviation of a turn rate that is computed from the wheels of a skidding robot, rad/s.
SKIDDING = 0.3
# The standard deviation of a speed that is computed from the wheels, as a part of it: they slip.
SLIPPING = 0.1
# Process noise of the heading, rad per square root of a second; it also keeps the gain defined
# where sensors have no noise.
UNSEEN = 0.005
SMALLEST = 1e-6  # rad


class Filter:
    """The filter of one run. Its state is x, y (m), heading (rad) and the gyro's bias (rad/s); the
    start is known exactly.

    The prediction uses the wheels' speeds and the gyro's turn rate. The compass corrects the
    heading and, through the covariance, also the bias and the position. Nothing else corrects the
    position, which drifts where wheels slip. It is written in scalars: arrays as small as these
    would take ten times as long.
    """

    def __init__(self, x: float, y: float, heading: float, sensors: Sensors) -> None:
        self._x = x
        self._y = y
        self._heading = wrap(heading)
        self._bias = 0.0
        self._speed = self._rate = 0.0
        self._compass_variance = sensors.compass**2 + SMALLEST**2
        gyro = sensors.gyro**2 + SMALLEST**2
        wheels = SKIDDING**2
        self._trust = wheels / (gyro + wheels)
        self._rate_variance = gyro * wheels / (gyro + wheels)
        # The upper half of the covariance of x, y, heading h and bias b, but for that of x with y,
        # which nothing needs.
        self._xx = self._xh = self._xb = 0.0
        self._yy = self._yh = self._yb = 0.0
        self._hh = self._hb = 0.0
        self._bb = sensors.gyro_bias**2

    @property
    def estimate(self) -> Estimate:
        spread = (
            math.sqrt(max(self._xx, 0.0)),
            math.sqrt(max(self._yy, 0.0)),
            math.sqrt(max(self._hh, 0.0)),
        )
        return Estimate(self._x, self._y, self._heading, self._speed, self._rate, spread)

    def advance(
        self, speed: float, wheel_rate: float, gyro_rate: float, pitch: float, seconds: float
    ) -> None:
        """The prediction: `seconds` pass at the wheels' `speed` (m/s).

        `wheel_rate` and `gyro_rate` (rad/s) are the turn rates from wheels and gyro, `pitch` (rad)
        is the robot's pitch.
        """
        trust = self._trust
        rate = trust * (gyro_rate - self._bias) + (1.0 - trust) * wheel_rate
        level = speed * math.cos(pitch)
        middle = self._heading + rate * seconds / 2
        cosine = math.cos(middle)
        sine = math.sin(middle)
        way = level * seconds
        self._x += way * cosine
        self._y += way * sine
        self._heading = wrap(self._heading + rate * seconds)
        self._speed = level
        self._rate = rate
        # The Jacobian: how an error of the heading and of the bias grows into the other errors.
        xh = -way * sine
        yh = way * cosine
        hb = -trust * seconds
        xb = xh * hb / 2
        yb = yh * hb / 2
        # The covariance P becomes F P F^T, where F is the identity except for these five entries.
        hh = self._hh
        h_b = self._hb
        bb = self._bb
        # The rows of F P for x, y and h, in the columns that are needed.
        x_h = self._xh + xh * hh + xb * h_b
        x_b = self._xb + xh * h_b + xb * bb
        y_h = self._yh + yh * hh + yb * h_b
        y_b = self._yb + yh * h_b + yb * bb
        self._xx += xh * (self._xh + x_h) + xb * (self._xb + x_b)
        self._yy += yh * (self._yh + y_h) + yb * (self._yb + y_b)
        self._xh = x_h + hb * x_b
        self._xb = x_b
        self._yh = y_h + hb * y_b
        self._yb = y_b
        self._hh = hh + hb * (2 * h_b + hb * bb)
        self._hb = h_b + hb * bb
        along = (SLIPPING * way) ** 2
        turned = self._rate_variance * seconds * seconds + UNSEEN**2 * seconds
        self._xx += along * cosine * cosine
        self._yy += along * sine * sine
        self._hh += turned

    def correct(self, compass: float) -> None:
        """The correction by the heading that the compass measures, `compass` (rad)."""
        surprise = wrap(compass - self._heading)
        total = self._hh + self._compass_variance
        kx = self._xh / total
        ky = self._yh / total
        kh = self._hh / total
        kb = self._hb / total
        self._x += kx * surprise
        self._y += ky * surprise
        self._heading = wrap(self._heading + kh * surprise)
        self._bias += kb * surprise
        xh = self._xh
        yh = self._yh
        hh = self._hh
        hb = self._hb
        self._xx -= kx * xh
        self._xh -= kx * hh
        self._xb -= kx * hb
        self._yy -= ky * yh
        self._yh -= ky * hh
        self._yb -= ky * hb
        self._hh -= kh * hh
        self._hb -= kh * hb
        self._bb -= kb * hb


def setup_of(robot: Model, drive: Drive, clock: Clock, scenario: Scenario, seed: int = 0) -> Setup:
    """What the controller of a run with this seed knows before it starts."""
    settings = scenario.controller
    goal = scenario.goal
    spawn = scenario.robot.spawn
    return Setup(
        goal=(goal.x, goal.y),
        tolerance=goal.tolerance,
        start=(spawn.x, spawn.y, spawn.yaw),
        joints=drive.joints,
        left=drive.left,
        radius=drive.radius,
        track=drive.track,
        footprint=footprint(robot),
        period=clock.command_period,
        speed=settings.speed,
        acceleration=settings.acceleration,
        turn_rate=settings.turn_rate,
        settings=settings,
        options=settings.options,
        seed=seed,
    )


class Autonomy:
    """The sensors, the pose filter and the controller of one run. The controller gets measurements,
    never the truth.

    `arrived` is the time (s) when the controller first reported that the robot is at its goal, None
    before.
    """

    def __init__(
        self,
        scenario: Scenario,
        suite: SensorSuite,
        drive: Drive,
        clock: Clock,
        controller: Drives,
        listener: Listener | None = None,
    ) -> None:
        """`listener` hears the controller."""
        self.arrived: float | None = None
        self._suite = suite
        self._left = [number for number, left in enumerate(drive.left) if left]
        self._right = [number for number, left in enumerate(drive.left) if not left]
        self._drive = drive
        self._skid = scenario.controller.skid
        self._step = clock.step
        self._controller = controller
        self._listener = listener
        spawn = scenario.robot.spawn
        self._filter = Filter(spawn.x, spawn.y, spawn.yaw, scenario.sensors)
        self._advanced = 0
        self._wheels = (0.0,) * len(drive.joints)
        self._imu = Imu(0.0, 0.0, 0.0)
        # What was measured since the last command, by the names of `Reading`.
        self._new: Data = {}

    @property
    def is_over(self) -> bool:
        """Whether a built-in controller has stopped for good."""
        return self.arrived is not None or bool(getattr(self._controller, "gave_up", False))

    def sense(self, tick: Tick, truth: Truth, scan: Scan | None) -> None:
        """Takes the measurements that are due at `tick`, and updates the pose estimate."""
        if tick.odometry:
            self._wheels = self._new["wheels"] = self._suite.odometry(truth.wheels)
        if tick.imu:
            self._imu = self._new["imu"] = self._suite.imu(truth)
        if (tick.odometry or tick.imu) and tick.step:
            # The mean speeds of the wheels' rims on both sides, m/s.
            left, right = (
                self._drive.radius * sum([self._wheels[number] for number in side]) / len(side)
                for side in (self._left, self._right)
            )
            self._filter.advance(
                speed=(left + right) / 2,
                wheel_rate=self._skid * (right - left) / self._drive.track,
                gyro_rate=self._imu.yaw_rate,
                pitch=self._imu.pitch,
                seconds=(tick.step - self._advanced) * self._step,
            )
            self._advanced = tick.step
        if tick.compass:
            self._new["compass"] = compass = self._suite.compass(truth)
            if tick.step:
                self._filter.correct(compass)
        if scan is not None:
            self._new["scan"] = scan

    def command(self, tick: Tick) -> Twist | WheelSpeeds:
        """The controller's command, valid until the next one. Raises BadCode."""
        new = self._new
        self._new = {}
        reading = Reading(tick.time, self._filter.estimate, **new)
        command = self._controller.step(reading)
        if self._listener is not None:
            self._listener.hear(reading, command)
        if self.arrived is None and getattr(self._controller, "arrived", False):
            self.arrived = tick.time
        return command
