"""The clock of a run: at which steps of the plant it records, commands and measures."""

from __future__ import annotations

from collections.abc import Mapping
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
    lidar: bool = False


@dataclass(frozen=True)
class Clock:
    """Time counted in steps of the plant, so that everything happens at the same instants in every
    run, to the last bit.

    `step` is in s; `last` is the step at which time is up. `every` has the number of steps between
    two rows of the recording, two commands, or two readings of a sensor, by the names of `Tick`.
    """

    step: float
    last: int
    every: Mapping[str, int]

    @classmethod
    def of(cls, scenario: Scenario) -> Clock:
        sensors = scenario.sensors
        step = scenario.simulation.time_step
        periods = {
            "record": RECORD_PERIOD,
            "command": scenario.controller.period,
            "compass": 1 / sensors.compass_rate,
            "imu": 1 / sensors.imu_rate,
            "odometry": 1 / sensors.odometry_rate,
        }
        if sensors.lidar:
            periods["lidar"] = 1 / sensors.lidar.rate
        every = {name: max(1, round(period / step)) for name, period in periods.items()}
        return cls(step, max(1, round(scenario.failure.timeout / step)), every)

    @property
    def seconds(self) -> float:
        """When time is up, s."""
        return self.last * self.step

    @property
    def command_period(self) -> float:
        """The time between two commands, s."""
        return self.every["command"] * self.step

    @property
    def period(self) -> float:
        """The longest time between two ticks, s."""
        return min(self.every.values()) * self.step

    @cached_property
    def ticks(self) -> tuple[Tick, ...]:
        """All steps at which something is due, from 0 to the last."""
        steps = {step for every in self.every.values() for step in range(0, self.last, every)} | {
            self.last
        }
        return tuple(
            Tick(
                step,
                step * self.step,
                **{name: step % every == 0 for name, every in self.every.items()},
            )
            for step in sorted(steps)
        )
