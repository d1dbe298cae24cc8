"""What the robot measures: a compass, the gyro of an IMU and the speeds of its wheels, each with noise of its own."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ddenv.world.scenario import Sensors


@dataclass(frozen=True, slots=True)
class Truth:
    """The robot as it is: world frame position (m) and heading (rad), body yaw rate (rad/s), wheel rim speeds (m/s)."""

    x: float
    y: float
    heading: float
    yaw_rate: float
    left: float
    right: float


@dataclass(frozen=True, slots=True)
class Measurement:
    """What the sensors say: heading (rad, world frame), yaw rate (rad/s), rim speeds of the left and right wheels (m/s)."""

    heading: float
    yaw_rate: float
    left: float
    right: float


class SensorSuite:
    """The sensors of one run. All their noise comes from one generator seeded with `seed`: same seed, same noise."""

    def __init__(self, noise: Sensors, seed: int) -> None:
        self._noise = noise
        self._random = np.random.default_rng(seed)
        # Drawn first and once: a compass that points wrong, a gyro that drifts, worn tyres.
        self._heading_bias, self._rate_bias, self._scale_error = self._random.standard_normal(3) * (
            noise.compass_bias,
            noise.gyro_bias,
            noise.odometry_bias,
        )

    def measure(self, truth: Truth) -> Measurement:
        """One reading of all sensors."""
        heading, rate, left, right = self._random.standard_normal(4)
        noise = self._noise
        scale = 1.0 + self._scale_error
        return Measurement(
            heading=truth.heading + self._heading_bias + noise.compass * heading,
            yaw_rate=truth.yaw_rate + self._rate_bias + noise.gyro * rate,
            left=truth.left * (scale + noise.odometry * left),
            right=truth.right * (scale + noise.odometry * right),
        )
