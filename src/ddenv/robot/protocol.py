"""What a controller is given, and what it gives back: the seam between the robot and whoever drives it.

A controller is a class. It is made anew for each run and asked for a command once every period:

    class Follow:
        def __init__(self, setup: Setup) -> None: ...
        def step(self, reading: Reading) -> Twist | WheelSpeeds: ...

It may have an attribute `arrived`, True once it believes that the robot has reached its goal.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from ddenv.robot.sensing.estimate import Estimate
from ddenv.robot.sensing.sensors import Imu, Scan


class Twist(NamedTuple):
    """Forward speed in m/s and turn rate in rad/s, positive to the left."""

    speed: float
    turn_rate: float


STOP = Twist(0.0, 0.0)


@dataclass(frozen=True, slots=True)
class WheelSpeeds:
    """Angular speeds (rad/s, positive forward) of wheel joints by name; a wheel that is not named stands still."""

    speeds: Mapping[str, float]


class Reading(NamedTuple):
    """What the robot knows at `time` (simulated s).

    `wheels` (rad/s) are the measured speeds of the wheel joints in the order of `Setup.joints`, `compass` (rad) the heading in the
    world frame. A sensor that has not measured since the last step gives None. `estimate` is what the robot's own filter
    makes of compass, IMU and odometry.
    """

    time: float
    estimate: Estimate
    wheels: tuple[float, ...] | None = None
    imu: Imu | None = None
    compass: float | None = None
    scan: Scan | None = None


@dataclass(frozen=True, slots=True)
class Setup:
    """What a controller knows before it starts.

    The goal is reached within `tolerance` (m) of `goal` (x, y in m, world frame), the robot starts at `start` (x, y, heading).
    `joints` are the wheels' joints, `left` tells the side of each; `radius` (m) is theirs, `track` (m) how far left and right are
    apart. `footprint` (m) is how far the robot reaches from its origin: ahead, behind, to its left, to its right. `period` is in
    s, the limits `speed`, `acceleration` and `turn_rate` in m/s, m/s^2 and rad/s. `settings` is the scenario's section
    `controller` and `options` what it says for an own controller. `seed` is that of the run.
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
    """A controller."""

    def step(self, reading: Reading) -> Twist | WheelSpeeds: ...
