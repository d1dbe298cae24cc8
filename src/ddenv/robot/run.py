"""One run: sense, estimate, command and simulate until the goal is reached or time is up."""

from __future__ import annotations

import math
import time
from collections.abc import Sequence

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from ddenv.robot.autonomy import Autonomy
from ddenv.robot.clock import Clock, Tick
from ddenv.robot.drive import Drive
from ddenv.robot.kinds import kind_of
from ddenv.robot.notice import Notice
from ddenv.robot.observe import Observer, PoseRow
from ddenv.robot.own import ControllerFailed
from ddenv.robot.plant import Body, Built
from ddenv.robot.recording import Recording
from ddenv.robot.result import Progress, RunResult
from ddenv.robot.sensing.lidar import Lidar
from ddenv.robot.sleep import Sleep
from ddenv.robot.stuck import Stuck
from ddenv.world.scenario import Scenario

# Outcome, failure, and whether the run was cut short.
End = tuple[str, str, bool]


class Run:
    """One run in a context that has been prepared: start poses set, removed models switched off.

    `kept` are the moving models that it records; `floor` (m) is the height below which the robot has fallen out of the world. With
    `stuck` the run ends as soon as that finds the robot stuck for good.
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
        autonomy: Autonomy,
        lidar: Lidar | None,
        stuck: Stuck | None,
        floor: float,
        kept: Sequence[Body],
        seed: int,
    ) -> None:
        self._goal = scenario.goal
        self._skid = scenario.controller.skid
        self._drive = drive
        self._clock = clock
        self._sleep = sleep
        self._notice = notice
        self._autonomy = autonomy
        self._lidar = lidar
        self._stuck = stuck
        self._floor = floor
        self._kept = kept
        self._seed = seed
        self._context = built.plant.GetMyMutableContextFromRoot(context)
        motors = built.plant.get_desired_state_input_port(built.robot.instance)
        # The wheels' positions, which no motor minds, and their speeds.
        self._told = np.zeros(motors.size())
        self._motors = motors.FixValue(self._context, self._told)
        self._observer = Observer(built, drive, self._context)
        self._simulator = Simulator(built.diagram, context)
        self._recording = Recording()

    def execute(self, progress: Progress | None) -> RunResult:
        """Runs to the end. What breaks in the simulation becomes a result; what `progress` raises is the caller's."""
        started = time.perf_counter()
        outcome, failure, cut, seconds = self._loop(progress)
        trajectory = self._recording.trajectory()
        if outcome == "failed":
            failure = kind_of(trajectory, fell=failure == "fell", arrived=self._autonomy.arrived)
        return RunResult(
            outcome=outcome,
            failure=failure,
            trajectory=trajectory,
            motions=self._recording.motions(),
            simulated_seconds=seconds,
            wall_seconds=time.perf_counter() - started,
            seed=self._seed,
            first_sensed=self._notice.first_sensed(self._lidar.first_seen if self._lidar else {}),
            first_touched=self._notice.first_touched,
            cut=cut,
        )

    def _loop(self, progress: Progress | None) -> tuple[str, str, bool, float]:
        """Outcome, failure, whether the run was cut short, and when (s) it ended."""
        for tick in self._clock.ticks:
            problem = self._simulate(tick.time) if tick.step else ""
            if problem:
                return "error", problem, False, tick.time
            self._sleep.tick(tick.step)
            if self._kept:
                # What is played back has been put in its place.
                self._observer.look()
            pose = self._observer.robot()
            truth = self._observer.truth(pose)
            end = self._end(pose, tick)
            if end is not None or tick.record:
                self._record(tick.time, pose, progress)
                self._notice.look(tick.time, pose[:3], truth.heading)
            if end is None:
                scan = self._lidar.scan(tick.time, pose, *self._sleep.poses()) if tick.lidar else None
                self._autonomy.sense(tick, truth, scan)
                end = self._command(tick) if tick.command else None
            if end is not None or tick.record:
                self._notice.feel(tick.time, pose[:3])
            if end is not None:
                return *end, tick.time
        raise AssertionError("a clock's last tick ends the run")

    def _end(self, pose: PoseRow, tick: Tick) -> End | None:
        """How a run ends that ends here, or None."""
        goal = self._goal
        if math.hypot(goal.x - pose[0], goal.y - pose[1]) <= goal.tolerance:
            return "pass", "", False
        if pose[2] < self._floor:
            return "failed", "fell", False
        if tick.step >= self._clock.last:
            return "failed", "", False
        if self._stuck is not None and tick.record and self._stuck.update(tick.time, pose):
            return "failed", "", True
        return None

    def _simulate(self, until: float) -> str:
        """Simulates up to the time `until`; returns what went wrong, or ""."""
        try:
            self._simulator.AdvanceTo(until)
        # Drake raises SystemExit where a condition of its own failed.
        except (RuntimeError, ValueError, SystemExit) as error:
            if not self._observer.look() or "nan" in str(error).lower():
                return "not-finite"
            return (str(error).strip() or type(error).__name__).splitlines()[0]
        return "" if self._observer.look() else "not-finite"

    def _command(self, tick: Tick) -> End | None:
        """Turns the wheels as the controller wants; returns how the run ends if that fails."""
        try:
            speeds = self._drive.wheel_speeds(self._autonomy.command(tick), self._skid)
        except ControllerFailed as failed:
            return "error", str(failed), False
        # What is told again would only have Drake work everything out anew.
        if (self._told[len(speeds) :] == speeds).all():
            return None
        self._told[len(speeds) :] = speeds
        self._motors.GetMutableData().get_mutable_value().SetFromVector(self._told)
        return None

    def _record(self, now: float, pose: PoseRow, progress: Progress | None) -> None:
        self._recording.add(now, pose, {body.name: self._observer.pose(body) for body in self._kept})
        if progress is not None:
            progress(now, pose)
