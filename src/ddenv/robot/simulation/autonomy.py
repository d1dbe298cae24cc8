"""The robot's own side of a run: what it measures, its pose estimate, and the commands of its controller."""

from __future__ import annotations

from typing import Any

from ddenv.robot.clock import Clock, Tick
from ddenv.robot.protocol import Drives, Imu, Reading, Scan, Setup, Twist, WheelSpeeds
from ddenv.robot.sensing.estimate import Filter
from ddenv.robot.sensing.sensors import SensorSuite, Truth
from ddenv.world.drive import Drive, footprint
from ddenv.world.model import Model
from ddenv.world.scenario import Scenario, Sensors


def setup_of(robot: Model, drive: Drive, clock: Clock, scenario: Scenario, seed: int = 0) -> Setup:
    """What the controller of a run with this seed knows before it starts."""
    settings, goal, spawn = scenario.controller, scenario.goal, scenario.robot.spawn
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
    """The sensors, the pose filter and the controller of one run. The controller gets measurements, never the truth.

    `arrived` is the time (s) when the controller first reported that the robot is at its goal, None before.
    """

    def __init__(
        self,
        settings: Sensors,
        suite: SensorSuite,
        drive: Drive,
        skid: float,
        clock: Clock,
        start: tuple[float, float, float],
        controller: Drives,
    ) -> None:
        """`start` (x, y in m, heading in rad, world frame) is the pose estimate at the start."""
        self.arrived: float | None = None
        self._suite = suite
        self._left = [number for number, left in enumerate(drive.left) if left]
        self._right = [number for number, left in enumerate(drive.left) if not left]
        self._drive, self._skid = drive, skid
        self._step = clock.step
        self._controller = controller
        self._filter = Filter(*start, settings)
        self._advanced = 0
        self._wheels = (0.0,) * len(drive.joints)
        self._imu = Imu(0.0, 0.0, 0.0)
        # What was measured since the last command, by the names of `Reading`.
        self._new: dict[str, Any] = {}

    def sense(self, tick: Tick, truth: Truth, scan: Scan | None) -> None:
        """Takes the measurements that are due at `tick`, and updates the pose estimate."""
        if tick.odometry:
            self._wheels = self._new["wheels"] = self._suite.odometry(truth.wheels)
        if tick.imu:
            self._imu = self._new["imu"] = self._suite.imu(truth)
        if tick.odometry or tick.imu:
            self._advance(tick.step)
        if tick.compass:
            self._new["compass"] = compass = self._suite.compass(truth)
            if tick.step:
                self._filter.correct(compass)
        if scan is not None:
            self._new["scan"] = scan

    def command(self, tick: Tick) -> Twist | WheelSpeeds:
        """The controller's command, valid until the next one. Raises ControllerFailed."""
        new, self._new = self._new, {}
        command = self._controller.step(Reading(tick.time, self._filter.estimate, **new))
        if self.arrived is None and getattr(self._controller, "arrived", False):
            self.arrived = tick.time
        return command

    def _advance(self, step: int) -> None:
        if step == self._advanced:
            return
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
            seconds=(step - self._advanced) * self._step,
        )
        self._advanced = step
