"""One run: sense, estimate, command and simulate until the goal is reached or time is up."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Sequence

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from ddenv.robot.clock import Clock
from ddenv.robot.drive import Drive
from ddenv.robot.estimate import Estimate, advance
from ddenv.robot.navigate import Command, Navigator
from ddenv.robot.notice import Notice
from ddenv.robot.observe import Observer, PoseRow
from ddenv.robot.plant import Body, Built
from ddenv.robot.recording import Recording
from ddenv.robot.result import RunResult
from ddenv.robot.sensors import SensorSuite
from ddenv.robot.sleep import Sleep
from ddenv.world.scenario import Scenario

Progress = Callable[[float, PoseRow], None]


class Run:
    """One run in a context that has been prepared: start poses set, removed models switched off.

    `kept` are the moving models that it records; `floor` (m) is the height below which the robot has fallen out of the world.
    """

    def __init__(
        self,
        built: Built,
        context: Context,
        scenario: Scenario,
        drive: Drive,
        clock: Clock,
        sleep: Sleep,
        notice: Notice,
        floor: float,
        kept: Sequence[Body],
        seed: int,
    ) -> None:
        self._scenario = scenario
        self._drive = drive
        self._clock = clock
        self._sleep = sleep
        self._notice = notice
        self._floor = floor
        self._kept = kept
        self._seed = seed
        self._context = built.plant.GetMyMutableContextFromRoot(context)
        self._motors = built.plant.get_desired_state_input_port(built.robot.instance)
        self._observer = Observer(built, drive, self._context)
        self._simulator = Simulator(built.diagram, context)
        self._sensors = SensorSuite(scenario.sensors, seed)
        self._navigator = Navigator(scenario.goal, scenario.controller)
        self._recording = Recording()

    def execute(self, progress: Progress | None) -> RunResult:
        """Runs to the end. What breaks in the simulation becomes a result; what `progress` raises is the caller's."""
        started = time.perf_counter()
        outcome, failure, step = self._loop(progress)
        first_sensed = self._notice.first_sensed()
        return RunResult(
            outcome=outcome,
            failure=failure,
            trajectory=self._recording.trajectory(),
            motions=self._recording.motions(),
            simulated_seconds=step * self._clock.step,
            wall_seconds=time.perf_counter() - started,
            seed=self._seed,
            first_sensed=first_sensed,
            first_touched=self._notice.first_touched,
        )

    def _loop(self, progress: Progress | None) -> tuple[str, str, int]:
        """Outcome, failure, and the step at which the run ended."""
        truth = self._observer.truth()
        # The robot knows where it starts.
        estimate = Estimate(truth.x, truth.y, truth.heading)
        step = 0
        while True:
            self._sleep.tick(step)
            now, pose = step * self._clock.step, self._observer.robot()
            end = self._end(pose, step)
            if end is not None or step % self._clock.record_every == 0:
                self._record(now, pose, progress)
                self._notice.look(now, pose[:3], truth.heading)
            if end is not None:
                self._notice.feel(now, pose[:3])
                return (*end, step)
            if step % self._clock.control_every == 0:
                if step > 0:
                    measured = self._sensors.measure(truth)
                    estimate = advance(
                        estimate, measured, self._scenario.sensors, self._clock.control_every * self._clock.step
                    )
                self._command(self._navigator.command(estimate))
            self._notice.feel(now, pose[:3])
            step = self._clock.next(step)
            problem = self._simulate(step * self._clock.step)
            if problem:
                return "error", problem, step
            truth = self._observer.truth()

    def _end(self, pose: PoseRow, step: int) -> tuple[str, str] | None:
        """Outcome and failure of a run that ends here, or None."""
        goal = self._scenario.goal
        if math.hypot(goal.x - pose[0], goal.y - pose[1]) <= goal.tolerance:
            return "pass", ""
        if pose[2] < self._floor:
            return "failed", "fell"
        return ("failed", "timeout") if step >= self._clock.last else None

    def _simulate(self, until: float) -> str:
        """Simulates up to the time `until`; returns what went wrong, or ""."""
        try:
            self._simulator.AdvanceTo(until)
        # Drake raises SystemExit where a condition of its own failed.
        except (RuntimeError, ValueError, SystemExit) as error:
            if not self._observer.is_finite() or "nan" in str(error).lower():
                return "not-finite"
            return (str(error).strip() or type(error).__name__).splitlines()[0]
        return "" if self._observer.is_finite() else "not-finite"

    def _command(self, command: Command) -> None:
        speeds = self._drive.wheel_speeds(command, self._scenario.controller.skid)
        self._motors.FixValue(self._context, np.concatenate([np.zeros_like(speeds), speeds]))

    def _record(self, now: float, pose: PoseRow, progress: Progress | None) -> None:
        self._recording.add(now, pose, {body.name: self._observer.pose(body) for body in self._kept})
        if progress is not None:
            progress(now, pose)
