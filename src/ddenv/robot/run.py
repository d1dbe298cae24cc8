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
from ddenv.robot.controllers import ControllerFailed
from ddenv.robot.drake.drive import Drive
from ddenv.robot.drake.plant import Body, Built
from ddenv.robot.notice import Notice
from ddenv.robot.oracle import kind_of
from ddenv.robot.piles.sleep import Sleep
from ddenv.robot.result import Progress, Recording, RunResult
from ddenv.robot.sensing.lidar import Lidar
from ddenv.robot.sensing.sensors import Truth
from ddenv.world.scenario import Controller, Scenario

PoseRow = tuple[float, ...]


class Observer:
    """Reads one context of the plant."""

    def __init__(self, built: Built, drive: Drive, plant_context: Context) -> None:
        plant, base = built.plant, built.robot.base
        self._plant = plant
        self._context = plant_context
        self._place = base.floating_positions_start()
        self._spin = plant.num_positions() + base.floating_velocities_start_in_v()
        joints = [plant.GetJointByName(name, built.robot.instance) for name in drive.joints]
        starts = [plant.num_positions() + joint.velocity_start() for joint in joints]
        self._wheels = list(zip(starts, drive.signs, strict=True))
        self._state: list[float] = []
        self.look()

    def look(self) -> bool:
        """Reads the state as it is now; returns whether all of it still consists of numbers."""
        self._state = self._plant.GetPositionsAndVelocities(self._context).tolist()
        # No sum of numbers comes near the largest one.
        return math.isfinite(sum(self._state))

    def pose(self, body: Body) -> PoseRow:
        """x, y, z (m), qw, qx, qy, qz of the first link of a model in the world frame, as of the last look."""
        if not body.base.is_floating_base_body():
            place = self._plant.EvalBodyPoseInWorld(self._context, body.base)
            return (*place.translation().tolist(), *place.rotation().ToQuaternion().wxyz().tolist())
        return self._floating(body.base.floating_positions_start())

    def robot(self) -> PoseRow:
        """The pose of the robot."""
        return self._floating(self._place)

    def truth(self, pose: PoseRow) -> Truth:
        """What the robot's sensors would measure without noise at its `pose`."""
        _, _, _, qw, qx, qy, qz = pose
        state, spin = self._state, self._spin
        # The gyro is fixed to the body: it measures the turning about the body's own z axis, given here in the world frame.
        up_x, up_y, up_z = 2 * (qx * qz + qw * qy), 2 * (qy * qz - qw * qx), 1 - 2 * (qx * qx + qy * qy)
        return Truth(
            heading=math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz)),
            roll=math.atan2(2 * (qy * qz + qw * qx), up_z),
            pitch=math.asin(min(1.0, max(-1.0, 2 * (qw * qy - qx * qz)))),
            yaw_rate=up_x * state[spin] + up_y * state[spin + 1] + up_z * state[spin + 2],
            wheels=tuple([sign * state[start] for start, sign in self._wheels]),
        )

    def _floating(self, start: int) -> PoseRow:
        # As the plant holds it: continuous, never jumping to the opposite quaternion, but not quite of unit length.
        qw, qx, qy, qz, x, y, z = self._state[start : start + 7]
        length = math.hypot(qw, qx, qy, qz)
        return x, y, z, qw / length, qx / length, qy / length, qz / length


# Who stays within so many m and rad for so long (s) is stuck. Wheels that slip in a rut rock a robot by less; one that turns on the
# spot, or backs up, leaves these limits in a fraction of a second.
RADIUS = 0.05
ANGLE = math.radians(5)
SECONDS = 8.0

# The controller `costmap` first stands still for its patience, clears its map and waits as long again before it backs up and
# turns: whoever watches must be more patient than that.
PATIENCES = 3.0


def seconds_for(controller: Controller) -> float:
    """How long a robot with this controller must not move to be stuck for good, s."""
    return max(SECONDS, PATIENCES * controller.planner.patience) if controller.use == "costmap" else SECONDS


class Stuck:
    """Is told each recorded pose of one run, in order of time.

    It is a guess: a robot may still come free later. That is why full runs confirm what is left after runs that were cut.
    """

    def __init__(self, seconds: float = SECONDS) -> None:
        self._seconds = seconds
        self._since = 0.0
        self._place: PoseRow | None = None

    def update(self, now: float, pose: PoseRow) -> bool:
        """Whether the robot is stuck at `now` (s); `pose` is x, y, z (m), qw, qx, qy, qz."""
        if self._place is None or _has_left(self._place, pose):
            self._since, self._place = now, pose
        # Times are sums of steps: what is due in 8 s may come 1e-15 s early.
        return now - self._since >= self._seconds - 1e-6


def _has_left(place: PoseRow, pose: PoseRow) -> bool:
    if math.dist(place[:3], pose[:3]) > RADIUS:
        return True
    # A rotation has two quaternions.
    likeness = abs(sum(a * b for a, b in zip(place[3:], pose[3:], strict=True)))
    return 2 * math.acos(min(1.0, likeness)) > ANGLE


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
