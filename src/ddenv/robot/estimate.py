"""Where the robot believes it is: dead reckoning on wheel speeds, with a heading fused from gyro and compass."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ddenv.robot.sensors import Measurement
from ddenv.world.scenario import Sensors

# Keeps the filter's gain defined when a scenario's sensors have no noise; rad^2, and rad^2 per second.
_SMALLEST = 1e-9


@dataclass(frozen=True, slots=True)
class Estimate:
    """Position (m) and heading (rad in [-pi, pi]) in the world frame, and the variance of the heading (rad^2)."""

    x: float
    y: float
    heading: float
    variance: float = 0.0


def advance(estimate: Estimate, measured: Measurement, noise: Sensors, dt: float) -> Estimate:
    """The estimate `dt` seconds later: a Kalman filter on the heading, predicted by the gyro and corrected by the compass.

    Position follows the mean rim speed along the mid heading of the step. No sensor corrects it: it drifts with slip.
    """
    predicted = estimate.heading + measured.yaw_rate * dt
    variance = estimate.variance + (noise.gyro**2 + noise.gyro_bias**2) * dt + _SMALLEST * dt
    gain = variance / (variance + noise.compass**2 + _SMALLEST)
    heading = wrap(predicted + gain * wrap(measured.heading - predicted))
    middle = estimate.heading + wrap(heading - estimate.heading) / 2
    way = (measured.left + measured.right) / 2 * dt
    x, y = estimate.x + way * math.cos(middle), estimate.y + way * math.sin(middle)
    return Estimate(x, y, heading, (1.0 - gain) * variance)


def wrap(angle: float) -> float:
    """`angle` (rad) in [-pi, pi]."""
    return math.remainder(angle, math.tau)
