"""When in a run something is due."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from ddenv.robot.recording import RECORD_PERIOD
from ddenv.world.scenario import Scenario


@dataclass(frozen=True)
class Clock:
    """Time counted in steps of the plant, so that every run does everything at the same instants to the last bit.

    `step` is in s; commands are due every `control_every` steps, rows of the recording every `record_every`, until `last`.
    """

    step: float
    control_every: int
    record_every: int
    last: int

    @classmethod
    def of(cls, scenario: Scenario) -> Clock:
        step = scenario.simulation.time_step
        seconds = (scenario.controller.period, RECORD_PERIOD, scenario.failure.timeout)
        return cls(step, *(max(1, round(period / step)) for period in seconds))

    @property
    def period(self) -> float:
        """The longest time between two steps at which something is due, s."""
        return min(self.control_every, self.record_every) * self.step

    def next(self, step: int) -> int:
        """The next step at which something is due."""
        due = min(step - step % every + every for every in (self.control_every, self.record_every))
        return min(due, self.last)

    def steps(self) -> Iterator[int]:
        """All steps at which something is due, from 0."""
        step = 0
        yield step
        while step < self.last:
            step = self.next(step)
            yield step
