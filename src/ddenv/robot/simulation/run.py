"""One run: simulate, sense, estimate and command until the goal is reached, time is up, or something breaks."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from ddenv.robot.clock import Tick
from ddenv.robot.controllers import ControllerFailed
from ddenv.robot.deadline import Stopwatch
from ddenv.robot.drake.context import RunContext
from ddenv.robot.drake.plant import Body, Built
from ddenv.robot.drake.region import Watch
from ddenv.robot.oracle import kind_of
from ddenv.robot.piles.sleep import Sleep
from ddenv.robot.result import PoseRow, Progress, Recording, RunResult
from ddenv.robot.sensing.lidar import Lidar
from ddenv.robot.sensing.sensors import Truth
from ddenv.robot.simulation.autonomy import Autonomy
from ddenv.robot.simulation.notice import Notice
from ddenv.robot.simulation.taking_part import Reached
from ddenv.world.drive import Drive
from ddenv.world.pose import Pose, angle_between
from ddenv.world.scenario import Controller, Scenario

# The maximum real time between two recorded poses that counts as time of the run, s.
LONGEST_LOOK = 10.0
# The outcome, the failure, and whether the run was cut short.
End = tuple[str, str, bool]


@dataclass(frozen=True)
class RunParts:
    """What one run consists of besides the plant. Without `watch` all of the world is in the plant.

    `kept` are the moving models whose motion is recorded. With `stuck` the run is cut short once the robot is stuck for good.
    Without `reached` it stays unknown who took part; `unusual` take part in any case.
    """

    scenario: Scenario
    drive: Drive
    sleep: Sleep
    notice: Notice
    autonomy: Autonomy
    lidar: Lidar | None
    watch: Watch | None
    stuck: Stuck | None
    reached: Reached | None
    unusual: frozenset[str]
    kept: Sequence[Body]
    seed: int


class Run:
    """One run in a prepared context: start poses are set, removed models are switched off."""

    def __init__(self, context: RunContext, parts: RunParts) -> None:
        built = context.built
        self._parts = parts
        self._clock = context.clock
        self._floor = context.floor
        motors = built.plant.get_desired_state_input_port(built.robot.instance)
        # The motors ignore the wheels' desired positions, which come first, and follow their desired speeds.
        self._commanded = np.zeros(motors.size())
        self._motors = motors.FixValue(context.plant_context, self._commanded)
        self._observer = Observer(built, parts.drive, parts.sleep, context.plant_context)
        self._simulator = Simulator(built.diagram, context.diagram_context)
        self._recording = Recording()
        self._wall_clock = Stopwatch(LONGEST_LOOK)

    def execute(self, progress: Progress | None) -> RunResult:
        """Runs to the end. What breaks in the simulation becomes a result; what `progress` raises is passed on.

        Raises LeftRegion if the plant lacks what comes near.
        """
        parts = self._parts
        outcome, failure, cut, seconds = self._loop(progress)
        trajectory = self._recording.trajectory()
        if outcome == "failed":
            failure = kind_of(trajectory, fell=failure == "fell", arrived=parts.autonomy.arrived)
        return RunResult(
            outcome=outcome,
            failure=failure,
            trajectory=trajectory,
            motions=self._recording.motions(),
            simulated_seconds=seconds,
            wall_seconds=self._wall_clock.look(),
            seed=parts.seed,
            first_sensed=parts.notice.first_sensed(parts.lidar.first_seen if parts.lidar else {}),
            first_touched=parts.notice.first_touched,
            cut=cut,
            took_part=None if outcome == "error" else self._took_part(),
        )

    def _took_part(self) -> frozenset[str] | None:
        parts = self._parts
        if parts.reached is None:
            return None
        seen = parts.lidar.took_part if parts.lidar else frozenset()
        return parts.reached.names | parts.sleep.took_part | seen | parts.unusual

    def _loop(self, progress: Progress | None) -> tuple[str, str, bool, float]:
        """The outcome, the failure, whether the run was cut short, and when (s) it ended."""
        parts = self._parts
        sleep, notice, autonomy, lidar = parts.sleep, parts.notice, parts.autonomy, parts.lidar
        for tick in self._clock.ticks:
            problem = self._simulate(tick.time) if tick.step else ""
            if problem:
                return "error", problem, False, tick.time
            sleep.tick(tick.step)
            if parts.kept:
                # Sleep has just moved the models that are played back.
                self._observer.look()
            pose = self._observer.robot()
            if parts.reached:
                parts.reached.look(pose, self._observer.speed(parts.reached.radius))
            if parts.watch:
                parts.watch.look(pose[:2], sleep.awake_boxes())
            truth = self._observer.truth(pose)
            end = self._end(pose, tick)
            if end is not None or tick.record:
                self._record(tick.time, pose, progress)
                notice.look(tick.time, pose[:3], truth.heading)
            if end is None:
                scan = lidar.scan(tick.time, pose, *sleep.poses()) if tick.lidar and lidar else None
                autonomy.sense(tick, truth, scan)
                end = self._command(tick) if tick.command else None
            if end is not None or tick.record:
                notice.feel(tick.time, pose[:3])
            if end is not None:
                return *end, tick.time
        raise AssertionError("the clock's last tick ends every run")

    def _end(self, pose: PoseRow, tick: Tick) -> End | None:
        """How the run ends if it ends at this tick, else None."""
        goal, stuck = self._parts.scenario.goal, self._parts.stuck
        if math.hypot(goal.x - pose[0], goal.y - pose[1]) <= goal.tolerance:
            return "pass", "", False
        if pose[2] < self._floor:
            return "failed", "fell", False
        if tick.step >= self._clock.last:
            return "failed", "", False
        if stuck is not None and tick.record and stuck.update(tick.time, pose):
            return "failed", "", True
        return None

    def _simulate(self, until: float) -> str:
        """Simulates up to the time `until` (s). Returns what went wrong, or ""."""
        try:
            self._simulator.AdvanceTo(until)
        # Drake raises SystemExit when one of its own checks fails.
        except (RuntimeError, ValueError, SystemExit) as error:
            if not self._observer.look() or "nan" in str(error).lower():
                return "not-finite"
            return (str(error).strip() or type(error).__name__).splitlines()[0]
        return "" if self._observer.look() else "not-finite"

    def _command(self, tick: Tick) -> End | None:
        """Sets the wheel speeds that the controller wants. Returns how the run ends if the controller fails."""
        parts = self._parts
        try:
            speeds = parts.drive.wheel_speeds(parts.autonomy.command(tick), parts.scenario.controller.skid)
        except ControllerFailed as failed:
            return "error", str(failed), False
        # Setting the same speeds again would only make Drake compute everything anew.
        if (self._commanded[len(speeds) :] == speeds).all():
            return None
        self._commanded[len(speeds) :] = speeds
        data: Any = self._motors.GetMutableData()
        data.get_mutable_value().SetFromVector(self._commanded)
        return None

    def _record(self, now: float, pose: PoseRow, progress: Progress | None) -> None:
        self._wall_clock.look()
        models = {body.name: self._observer.pose(body) for body in self._parts.kept}
        self._recording.add(now, pose, models)
        if progress is not None:
            progress(now, pose, models)


class Observer:
    """Reads poses, and what ideal sensors would measure, from one context of the plant."""

    def __init__(self, built: Built, drive: Drive, sleep: Sleep, plant_context: Context) -> None:
        plant, base = built.plant, built.robot.base
        self._sleep = sleep
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
        """Reads the state as it is now. Returns whether it is finite."""
        self._state = self._sleep.state().tolist()
        # A sum of finite states does not overflow: none comes near the largest float.
        return math.isfinite(sum(self._state))

    def pose(self, body: Body) -> PoseRow:
        """The pose of a model's first link in the world frame, as of the last look: x, y, z (m), qw, qx, qy, qz."""
        if not body.base.is_floating_base_body():
            place = self._plant.EvalBodyPoseInWorld(self._context, body.base)
            x, y, z = place.translation().tolist()
            qw, qx, qy, qz = place.rotation().ToQuaternion().wxyz().tolist()
            return x, y, z, qw, qx, qy, qz
        return self._floating(body.base.floating_positions_start())

    def robot(self) -> PoseRow:
        """The pose of the robot's first link, as in `pose`."""
        return self._floating(self._place)

    def speed(self, radius: float) -> float:
        """A bound of the speed (m/s) of what is rigid with the robot's first link, and within `radius` (m) of its origin."""
        wx, wy, wz, vx, vy, vz = self._state[self._spin : self._spin + 6]
        return math.hypot(vx, vy, vz) + radius * math.hypot(wx, wy, wz)

    def truth(self, pose: PoseRow) -> Truth:
        """What the robot's sensors would measure without noise at its `pose`."""
        qw, qx, qy, qz = pose[3:]
        roll, pitch, heading = Pose(pose[:3], pose[3:]).rpy()
        state, spin = self._state, self._spin
        # The gyro is fixed to the body: it measures the rotation about the body's own z axis, here in the world frame.
        up_x, up_y, up_z = 2 * (qx * qz + qw * qy), 2 * (qy * qz - qw * qx), 1 - 2 * (qx * qx + qy * qy)
        return Truth(
            heading=heading,
            roll=roll,
            pitch=pitch,
            yaw_rate=up_x * state[spin] + up_y * state[spin + 1] + up_z * state[spin + 2],
            wheels=tuple([sign * state[start] for start, sign in self._wheels]),
        )

    def _floating(self, start: int) -> PoseRow:
        # The plant's own quaternion: continuous, never jumping to its negative, but not exactly of unit length.
        qw, qx, qy, qz, x, y, z = self._state[start : start + 7]
        length = math.hypot(qw, qx, qy, qz)
        return x, y, z, qw / length, qx / length, qy / length, qz / length


# A robot that stays within this distance (m) and angle (rad) for this time (s) is stuck. Wheels that slip in a rut rock a robot by
# less; a robot that turns on the spot or backs up leaves these limits in a fraction of a second.
RADIUS = 0.05
ANGLE = math.radians(5)
SECONDS = 8.0

# The controller `costmap` first stands still for its patience, clears its map and waits as long again before it backs up and
# turns: nobody may call it stuck before that.
PATIENCES = 3.0


class Stuck:
    """Finds out whether a robot is stuck for good, from the recorded poses of one run.

    It is a guess: a robot may still come free later. So runs that were not cut short confirm what a reduction leaves.
    """

    def __init__(self, seconds: float = SECONDS) -> None:
        """`seconds` is how long the robot must not have moved."""
        self._seconds = seconds
        self._since = 0.0
        self._place: PoseRow | None = None

    def update(self, now: float, pose: PoseRow) -> bool:
        """Whether the robot is stuck at `now` (s). Call it for each recorded pose, in order of time."""
        place = self._place
        if place is None or math.dist(place[:3], pose[:3]) > RADIUS or angle_between(place[3:], pose[3:]) > ANGLE:
            self._since, self._place = now, pose
        # Times are sums of steps: 8 s may come out 1e-15 s short.
        return now - self._since >= self._seconds - 1e-6


def seconds_for(controller: Controller) -> float:
    """How long a robot with this controller must not move to be stuck for good, s."""
    return max(SECONDS, PATIENCES * controller.planner.patience) if controller.use == "costmap" else SECONDS
