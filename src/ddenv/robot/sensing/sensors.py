"""What the robot measures of itself: a compass, an IMU and the speeds of its wheels, each with noise of its own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ddenv.world.pose import Vector
from ddenv.world.scenario import Sensors


class Imu(NamedTuple):
    """Turn rate about the robot's own vertical (rad/s), roll and pitch (rad)."""

    yaw_rate: float
    roll: float
    pitch: float


@dataclass(frozen=True, slots=True)
class Scan:
    """One turn of the lidar, taken at one instant.

    `angles` (N,) rad are the beams' directions in the robot's frame, counterclockwise from its x axis, `ranges` (N,) m how far
    they went, infinite where they met nothing. `origin` (m) is the lidar's place in the frame of the robot's first link.
    """

    time: float
    angles: np.ndarray
    ranges: np.ndarray
    origin: Vector

    def points(self) -> np.ndarray:
        """Where the beams ended that met something, shape (M, 3) m, in the frame of the robot's first link."""
        met = np.isfinite(self.ranges)
        ranges, angles = self.ranges[met], self.angles[met]
        x, y, z = self.origin
        return np.column_stack([x + ranges * np.cos(angles), y + ranges * np.sin(angles), np.full(len(ranges), z)])


# Numbers drawn at once: one at a time would cost more than all that is done with them.
DRAWN = 256


class Truth(NamedTuple):
    """The robot as it is: heading, roll and pitch (rad, world frame), turn rate about its own vertical (rad/s).

    `wheels` (rad/s) are the speeds of its wheels, positive forward.
    """

    heading: float
    roll: float
    pitch: float
    yaw_rate: float
    wheels: tuple[float, ...]


class Noise:
    """Standard normal numbers, one after the other."""

    def __init__(self, random: np.random.Generator) -> None:
        self._random = random
        self._drawn: list[float] = []

    def next(self) -> float:
        if not self._drawn:
            self._drawn = self._random.standard_normal(DRAWN).tolist()
        return self._drawn.pop()


class SensorSuite:
    """The sensors of one run. Same seed, same noise; each sensor has its own, whatever the others measure.

    `lidar` is the source of the lidar's noise.
    """

    def __init__(self, settings: Sensors, seed: int) -> None:
        self._settings = settings
        *own, self.lidar = (np.random.default_rng(each) for each in np.random.SeedSequence(seed).spawn(4))
        self._compass, self._imu, self._odometry = (Noise(random) for random in own)
        # Drawn first and once: a compass that points wrong, a gyro that drifts, worn tyres.
        self._heading_bias = settings.compass_bias * self._compass.next()
        self._rate_bias = settings.gyro_bias * self._imu.next()
        self._scale = 1.0 + settings.odometry_bias * self._odometry.next()

    def compass(self, truth: Truth) -> float:
        """The heading, rad."""
        return truth.heading + self._heading_bias + self._settings.compass * self._compass.next()

    def imu(self, truth: Truth) -> Imu:
        settings, noise = self._settings, self._imu
        return Imu(
            yaw_rate=truth.yaw_rate + self._rate_bias + settings.gyro * noise.next(),
            roll=truth.roll + settings.tilt * noise.next(),
            pitch=truth.pitch + settings.tilt * noise.next(),
        )

    def odometry(self, wheels: Sequence[float]) -> tuple[float, ...]:
        """What the wheels say (rad/s): they turn as fast where they slip."""
        scale, spread, noise = self._scale, self._settings.odometry, self._odometry
        return tuple([speed * (scale + spread * noise.next()) for speed in wheels])
