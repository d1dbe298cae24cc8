"""The interface of a controller: what it gets at the start and at every step, and what it returns.

A controller is a class. Each run makes a new one, and asks it for a command once every period:

    class Follow:
        def __init__(self, setup: Setup) -> None: ...
        def step(self, reading: Reading) -> Twist | WheelSpeeds: ...

It may have an attribute `arrived`, True once its pose estimate says that the robot has reached its
goal.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

import numpy as np

from ddenv.arrays import Floats
from ddenv.text import Names
from ddenv.world.drive import Twist as Twist
from ddenv.world.drive import WheelSpeeds as WheelSpeeds
from ddenv.world.pose import Point, Vector

STOP = Twist(0.0, 0.0)


class Estimate(NamedTuple):
    """A pose estimate: position (m) and heading (rad in [-pi, pi]) in the world frame, speed
    forward (m/s), turn rate (rad/s).

    `spread` are the standard deviations of x, y (m) and of the heading (rad), as the filter
    estimates them.
    """

    x: float
    y: float
    heading: float
    speed: float = 0.0
    turn_rate: float = 0.0
    spread: tuple[float, float, float] = (0.0, 0.0, 0.0)


class Imu(NamedTuple):
    """The turn rate about the robot's own vertical axis (rad/s), roll and pitch (rad)."""

    yaw_rate: float
    roll: float
    pitch: float


@dataclass(frozen=True, slots=True)
class Scan:
    """One scan of the lidar, taken at one instant (`time`, s).

    `angles` (N,) rad are the beams' directions in the robot's frame, counterclockwise from its x
    axis. `ranges` (N,) m are the measured distances, infinite where a beam hit nothing. `origin`
    (m) is the lidar's position in the frame of the robot's first link.
    """

    time: float
    angles: Floats
    ranges: Floats
    origin: Vector

    def within(self, limits: Floats) -> Floats:
        """The ranges, infinite where they exceed `limits` (N,) m: then what lies beyond takes no
        part in the run.
        """
        ranges: Floats = np.where(self.ranges <= limits, self.ranges, np.inf)
        return ranges

    def points(self) -> Floats:
        """Where beams hit something, shape (M, 3) m, in the frame of the robot's first link."""
        met = np.isfinite(self.ranges)
        ranges = self.ranges[met]
        angles = self.angles[met]
        x, y, z = self.origin
        return np.column_stack(
            [x + ranges * np.cos(angles), y + ranges * np.sin(angles), np.full(len(ranges), z)]
        )


class Reading(NamedTuple):
    """What the robot knows at `time` (simulated s).

    `estimate` is the robot's pose estimate, filtered from odometry, IMU and compass. `wheels`
    (rad/s) are the measured speeds of the wheel joints in the order of `Setup.joints`, positive
    forward. `compass` (rad) is the heading in the world frame. A sensor that has not measured since
    the last step is None.
    """

    time: float
    estimate: Estimate
    wheels: tuple[float, ...] | None = None
    imu: Imu | None = None
    compass: float | None = None
    scan: Scan | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Setup:
    """What a controller knows before the run starts.

    The goal is reached within `tolerance` (m) of `goal` (x, y in m, world frame). The robot starts
    at `start` (x, y in m, heading in rad, world frame). `joints` are the wheel joints, `left` is
    True for those on the left side; `radius` (m) is the wheels' radius, `track` (m) the distance
    between left and right ones. `footprint` (m) is how far the robot extends from its origin:
    ahead, behind, to its left, to its right. `period` (s) is the time between two commands; `speed`
    (m/s), `acceleration` (m/s^2) and `turn_rate` (rad/s) are limits. `settings` is the scenario's
    section `controller`, `options` are the scenario's options for a controller of your own. `seed`
    is the seed of the run.
    """

    goal: Point
    tolerance: float
    start: Vector
    joints: Names
    left: tuple[bool, ...]
    radius: float
    track: float
    footprint: tuple[float, float, float, float]
    period: float
    speed: float
    acceleration: float
    turn_rate: float
    settings: Any = None
    options: Mapping[str, Any] = field(default_factory=dict)
    seed: int = 0


class Drives(Protocol):
    """Anything that drives a robot."""

    def step(self, reading: Reading) -> Twist | WheelSpeeds: ...
