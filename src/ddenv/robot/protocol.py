"""The interface of a controller: what it gets at the start and at every step, and what it returns.

A controller is a class. Each run makes a new one, and asks it for a command once every period:

    class Follow:
        def __init__(self, setup: Setup) -> None: ...
        def step(self, reading: Reading) -> Twist | WheelSpeeds: ...

It may have an attribute `arrived`, True once its pose estimate says that the robot has reached its goal.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from ddenv.robot.sensing.estimate import Estimate
from ddenv.robot.sensing.sensors import Imu, Scan
from ddenv.world.drive import Twist as Twist
from ddenv.world.drive import WheelSpeeds as WheelSpeeds

STOP = Twist(0.0, 0.0)


class Reading(NamedTuple):
    """What the robot knows at `time` (simulated s).

    `estimate` is the robot's pose estimate, filtered from odometry, IMU and compass. `wheels` (rad/s) are the measured speeds of
    the wheel joints in the order of `Setup.joints`, positive forward. `compass` (rad) is the heading in the world frame. A
    sensor that has not measured since the last step is None.
    """

    time: float
    estimate: Estimate
    wheels: tuple[float, ...] | None = None
    imu: Imu | None = None
    compass: float | None = None
    scan: Scan | None = None


@dataclass(frozen=True, slots=True)
class Setup:
    """What a controller knows before the run starts.

    The goal is reached within `tolerance` (m) of `goal` (x, y in m, world frame). The robot starts at `start` (x, y in m, heading
    in rad, world frame). `joints` are the wheel joints, `left` is True for those on the left side; `radius` (m) is the wheels'
    radius, `track` (m) the distance between left and right ones. `footprint` (m) is how far the robot extends from its origin:
    ahead, behind, to its left, to its right. `period` (s) is the time between two commands; `speed` (m/s), `acceleration` (m/s^2)
    and `turn_rate` (rad/s) are limits. `settings` is the scenario's section `controller`, `options` are the scenario's options for
    a controller of your own. `seed` is the seed of the run.
    """

    goal: tuple[float, float]
    tolerance: float
    start: tuple[float, float, float]
    joints: tuple[str, ...]
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
