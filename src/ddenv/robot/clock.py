"""The clock of a run: at which steps of the plant it records, commands and measures."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from ddenv.robot.result import RECORD_PERIOD
from ddenv.world.scenario import Scenario


class Tick(NamedTuple):
    """A step of the plant at which something is due, its time (s), and what is due."""

    step: int
    time: float
    record: bool
    command: bool
    compass: bool
    imu: bool
    odometry: bool
    lidar: bool


@dataclass(frozen=True)
class Clock:
    """Time counted in steps of the plant, so that everything happens at the same instants in every run, to the last bit.

    `step` is in s; `last` is the step at which time is up. Each of the others is the number of steps between two rows of the
    recording, two commands, or two readings of a sensor.
    """

    step: float
    last: int
    record: int
    command: int
    compass: int
    imu: int
    odometry: int
    lidar: int | None

    @classmethod
    def of(cls, scenario: Scenario) -> Clock:
        sensors, step = scenario.sensors, scenario.simulation.time_step

        def steps(period: float) -> int:
            return max(1, round(period / step))

        return cls(
            step=step,
            last=steps(scenario.failure.timeout),
            record=steps(RECORD_PERIOD),
            command=steps(scenario.controller.period),
            compass=steps(1 / sensors.compass_rate),
            imu=steps(1 / sensors.imu_rate),
            odometry=steps(1 / sensors.odometry_rate),
            lidar=steps(1 / sensors.lidar.rate) if sensors.lidar else None,
        )

    @property
    def command_period(self) -> float:
        """The time between two commands, s."""
        return self.command * self.step

    @property
    def period(self) -> float:
        """The longest time between two ticks, s."""
        return min(self._every) * self.step

    @property
    def _every(self) -> tuple[int, ...]:
        both = self.record, self.command, self.compass, self.imu, self.odometry, self.lidar
        return tuple(steps for steps in both if steps)

    @cached_property
    def ticks(self) -> tuple[Tick, ...]:
        """All steps at which something is due, from 0 to the last."""
        due = {step for steps in self._every for step in range(0, self.last, steps)}
        return tuple(self._tick(step) for step in sorted(due | {self.last}))

    def _tick(self, step: int) -> Tick:
        def due(steps: int | None) -> bool:
            return steps is not None and step % steps == 0

        return Tick(
            step=step,
            time=step * self.step,
            record=due(self.record),
            command=due(self.command),
            compass=due(self.compass),
            imu=due(self.imu),
            odometry=due(self.odometry),
            lidar=due(self.lidar),
        )
