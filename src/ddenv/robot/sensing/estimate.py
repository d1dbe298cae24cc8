"""The robot's pose estimate: an extended Kalman filter on wheel odometry, IMU and compass."""

from __future__ import annotations

import math

from ddenv.robot.protocol import Estimate
from ddenv.world.pose import wrap
from ddenv.world.scenario import Sensors

# The standard deviation of a turn rate that is computed from the wheels of a skidding robot, rad/s.
SKIDDING = 0.3
# The standard deviation of a speed that is computed from the wheels, as a part of it: they slip.
SLIPPING = 0.1
# Process noise of the heading, rad per square root of a second; it also keeps the gain defined where sensors have no noise.
UNSEEN = 0.005
SMALLEST = 1e-6  # rad


class Filter:
    """The filter of one run. Its state is x, y (m), heading (rad) and the gyro's bias (rad/s); the start is known exactly.

    The prediction uses the wheels' speeds and the gyro's turn rate. The compass corrects the heading and, through the covariance,
    also the bias and the position. Nothing else corrects the position, which drifts where wheels slip.
    It is written in scalars: arrays as small as these would take ten times as long.
    """

    def __init__(self, x: float, y: float, heading: float, sensors: Sensors) -> None:
        self._x, self._y, self._heading, self._bias = x, y, wrap(heading), 0.0
        self._speed = self._rate = 0.0
        self._compass_variance = sensors.compass**2 + SMALLEST**2
        gyro, wheels = sensors.gyro**2 + SMALLEST**2, SKIDDING**2
        self._trust = wheels / (gyro + wheels)
        self._rate_variance = gyro * wheels / (gyro + wheels)
        # The upper half of the covariance of x, y, heading h and bias b.
        self._xx = self._xy = self._xh = self._xb = 0.0
        self._yy = self._yh = self._yb = 0.0
        self._hh = self._hb = 0.0
        self._bb = sensors.gyro_bias**2

    @property
    def estimate(self) -> Estimate:
        spread = math.sqrt(max(self._xx, 0.0)), math.sqrt(max(self._yy, 0.0)), math.sqrt(max(self._hh, 0.0))
        return Estimate(self._x, self._y, self._heading, self._speed, self._rate, spread)

    def advance(self, speed: float, wheel_rate: float, gyro_rate: float, pitch: float, seconds: float) -> None:
        """The prediction: `seconds` pass at the wheels' `speed` (m/s).

        `wheel_rate` and `gyro_rate` (rad/s) are the turn rates from wheels and gyro, `pitch` (rad) is the robot's pitch.
        """
        trust = self._trust
        rate = trust * (gyro_rate - self._bias) + (1.0 - trust) * wheel_rate
        level = speed * math.cos(pitch)
        middle = self._heading + rate * seconds / 2
        cosine, sine = math.cos(middle), math.sin(middle)
        way = level * seconds
        self._x += way * cosine
        self._y += way * sine
        self._heading = wrap(self._heading + rate * seconds)
        self._speed, self._rate = level, rate
        # The Jacobian: how an error of the heading and of the bias grows into the other errors.
        xh, yh, hb = -way * sine, way * cosine, -trust * seconds
        xb, yb = xh * hb / 2, yh * hb / 2
        self._spread_errors(xh, yh, hb, xb, yb)
        along = (SLIPPING * way) ** 2
        turned = self._rate_variance * seconds * seconds + UNSEEN**2 * seconds
        self._xx += along * cosine * cosine
        self._xy += along * cosine * sine
        self._yy += along * sine * sine
        self._hh += turned

    def _spread_errors(self, xh: float, yh: float, hb: float, xb: float, yb: float) -> None:
        """The covariance P becomes F P F^T, where F is the identity except for these five entries."""
        hh, h_b, bb = self._hh, self._hb, self._bb
        # The rows of F P for x, y and h, in the columns that are needed.
        x_h = self._xh + xh * hh + xb * h_b
        x_b = self._xb + xh * h_b + xb * bb
        y_h = self._yh + yh * hh + yb * h_b
        y_b = self._yb + yh * h_b + yb * bb
        self._xx += xh * (self._xh + x_h) + xb * (self._xb + x_b)
        self._xy += xh * self._yh + xb * self._yb + yh * x_h + yb * x_b
        self._yy += yh * (self._yh + y_h) + yb * (self._yb + y_b)
        self._xh, self._xb = x_h + hb * x_b, x_b
        self._yh, self._yb = y_h + hb * y_b, y_b
        self._hh = hh + hb * (2 * h_b + hb * bb)
        self._hb = h_b + hb * bb

    def correct(self, compass: float) -> None:
        """The correction by the heading that the compass measures, `compass` (rad)."""
        surprise = wrap(compass - self._heading)
        total = self._hh + self._compass_variance
        kx, ky, kh, kb = self._xh / total, self._yh / total, self._hh / total, self._hb / total
        self._x += kx * surprise
        self._y += ky * surprise
        self._heading = wrap(self._heading + kh * surprise)
        self._bias += kb * surprise
        xh, yh, hh, hb = self._xh, self._yh, self._hh, self._hb
        self._xx -= kx * xh
        self._xy -= kx * yh
        self._xh -= kx * hh
        self._xb -= kx * hb
        self._yy -= ky * yh
        self._yh -= ky * hh
        self._yb -= ky * hb
        self._hh -= kh * hh
        self._hb -= kh * hb
        self._bb -= kb * hb
