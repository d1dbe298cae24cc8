"""The robot's own sensors: compass, IMU and wheel odometry, each with its own noise; and what a lidar scan is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ddenv.robot.protocol import Imu
from ddenv.world.scenario import Sensors

# Random numbers drawn at once: drawing them one at a time would cost more than all that is done with them.
DRAWN = 256


class Truth(NamedTuple):
    """The robot's true heading, roll and pitch (rad, world frame), and turn rate about its own vertical axis (rad/s).

    `wheels` (rad/s) are the wheels' speeds, positive forward.
    """

    heading: float
    roll: float
    pitch: float
    yaw_rate: float
    wheels: tuple[float, ...]


class Noise:
    """A stream of standard normal numbers."""

    def __init__(self, random: np.random.Generator) -> None:
        self._random = random
        self._drawn: list[float] = []

    def next(self) -> float:
        if not self._drawn:
            self._drawn = self._random.standard_normal(DRAWN).tolist()
        return self._drawn.pop()


class SensorSuite:
    """The noisy sensors of one run. The same seed gives the same noise; each sensor has its own stream, whatever others measure.

    `lidar` is the random generator for the lidar's noise.
    """

    def __init__(self, settings: Sensors, seed: int) -> None:
        self._settings = settings
        *own, self.lidar = (np.random.default_rng(each) for each in np.random.SeedSequence(seed).spawn(4))
        self._compass, self._imu, self._odometry = (Noise(random) for random in own)
        # Drawn first, once a run: the compass's misalignment, the gyro's drift, the wear of the tyres.
        self._heading_bias = settings.compass_bias * self._compass.next()
        self._rate_bias = settings.gyro_bias * self._imu.next()
        self._scale = 1.0 + settings.odometry_bias * self._odometry.next()

    def compass(self, truth: Truth) -> float:
        """The measured heading, rad."""
        return truth.heading + self._heading_bias + self._settings.compass * self._compass.next()

    def imu(self, truth: Truth) -> Imu:
        """The measured turn rate, roll and pitch."""
        settings, noise = self._settings, self._imu
        return Imu(
            yaw_rate=truth.yaw_rate + self._rate_bias + settings.gyro * noise.next(),
            roll=truth.roll + settings.tilt * noise.next(),
            pitch=truth.pitch + settings.tilt * noise.next(),
        )

    def odometry(self, wheels: Sequence[float]) -> tuple[float, ...]:
        """The measured speeds of the wheels, rad/s; a wheel that slips is not distinguished from one that grips."""
        scale, spread, noise = self._scale, self._settings.odometry, self._odometry
        return tuple([speed * (scale + spread * noise.next()) for speed in wheels])
