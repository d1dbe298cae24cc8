"""One run: simulate, sense, estimate and command until the goal is reached, time is up, or
something breaks.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from pydrake.systems.analysis import Simulator

from ddenv.robot.clock import Tick
from ddenv.robot.controllers import BadCode
from ddenv.robot.deadline import Stopwatch
from ddenv.robot.drake.plant import Body
from ddenv.robot.drake.run_context import RunContext
from ddenv.robot.oracle import kind_of
from ddenv.robot.piles.sleep import Sleep
from ddenv.robot.result import PoseRow, Progress, Recording, RunResult
from ddenv.robot.sensing.autonomy import Autonomy, Truth
from ddenv.robot.sensing.lidar import Lidar
from ddenv.robot.simulation.notice import Notice
from ddenv.robot.simulation.rest import SLOW, Rest
from ddenv.robot.simulation.taking_part import Reached
from ddenv.world.drive import Drive
from ddenv.world.pose import Pose
from ddenv.world.scenario import Scenario

UNSOLVED = "did not converge"  # in what Drake's solver says when it finds no contact forces
LONGEST_LOOK = (
    10.0  # the maximum real time between two recorded poses that counts as time of the run, s
)
# The outcome, the failure, and whether the run was cut short.
End = tuple[str, str, bool]


@dataclass(eq=False, kw_only=True)
class Run:
    """One run in a prepared context: start poses are set, removed models are switched off.

    No part of the robot is farther than `reach` (m) from its first link. `kept` are the moving
    models whose motion is recorded. With `rest` the run is cut short once the robot is at rest for
    good. Without `reached` it stays unknown who took part; `unusual` take part in any case.
    """

    context: RunContext
    scenario: Scenario
    drive: Drive
    sleep: Sleep
    notice: Notice
    autonomy: Autonomy
    lidar: Lidar | None
    reach: float
    rest: Rest | None
    reached: Reached | None
    unusual: frozenset[str]
    kept: Sequence[Body]
    seed: int

    def __post_init__(self) -> None:
        built = self.context.built
        plant = built.plant
        base = built.robot.base
        motors = plant.get_desired_state_input_port(built.robot.instance)
        # The motors ignore the wheels' desired positions, which come first, and follow their
        # desired speeds.
        self._commanded = np.zeros(motors.size())
        self._motors = motors.FixValue(self.context.plant_context, self._commanded)
        self._place = base.floating_positions_start()
        self._spin = plant.num_positions() + base.floating_velocities_start_in_v()
        joints = [plant.GetJointByName(name, built.robot.instance) for name in self.drive.joints]
        starts = [plant.num_positions() + joint.velocity_start() for joint in joints]
        self._wheels = list(zip(starts, self.drive.signs, strict=True))
        # The plant's positions and velocities as of the last look.
        self._state: list[float] = []
        self._look()
        self._simulator = Simulator(built.diagram, self.context.diagram_context)
        self._recording = Recording()
        self._wall_clock = Stopwatch(LONGEST_LOOK)

    def execute(self, progress: Progress | None) -> RunResult:
        """Runs to the end. What breaks in the simulation becomes a result; what `progress` raises
        is passed on.

        Raises LeftRegion if the plant lacks what comes near.
        """
        outcome, failure, cut, seconds = self._loop(progress or (lambda *_: None))
        trajectory = self._recording.trajectory()
        if outcome == "failed":
            if cut:
                whole = np.vstack([trajectory, [self.context.clock.seconds, *trajectory[-1, 1:]]])
            else:
                whole = trajectory
            failure = kind_of(whole, fell=failure == "fell", arrived=self.autonomy.arrived)
        seen = self.lidar.first_seen if self.lidar else {}
        took_part = None
        if self.reached and outcome != "error":
            read = self.lidar.took_part if self.lidar else {}
            took_part = self.reached.names | self.sleep.took_part | read.keys() | self.unusual
            # In scans that nobody reads, a model that does not affect the run may hide one that
            # does: only scans that were read give the same times in smaller worlds.
            seen = {name: at for name, at in seen.items() if name not in took_part} | read
        return RunResult(
            outcome=outcome,
            failure=failure,
            trajectory=trajectory,
            motions=self._recording.motions(),
            simulated_seconds=seconds,
            wall_seconds=self._wall_clock.look(),
            seed=self.seed,
            first_sensed=self.notice.first_sensed(seen),
            first_touched=self.notice.first_touched,
            cut=cut,
            took_part=took_part,
        )

    def _loop(self, progress: Progress) -> tuple[str, str, bool, float]:
        """The outcome, the failure, whether the run was cut short, and when (s) it ended."""
        sleep = self.sleep
        notice = self.notice
        lidar = self.lidar
        for tick in self.context.clock.ticks:
            problem = self._simulate(tick.time) if tick.step else ""
            if problem:
                return "error", problem, False, tick.time
            sleep.tick(tick.step)
            if self.kept:
                # Sleep has just moved the models that are played back.
                self._look()
            pose = self._floating(self._place)
            if self.reached:
                # No part that is rigid with the first link is faster.
                wx, wy, wz, vx, vy, vz = self._state[self._spin : self._spin + 6]
                speed = math.hypot(vx, vy, vz) + self.reached.radius * math.hypot(wx, wy, wz)
                self.reached.look(pose, speed)
            if self.context.region:
                self.context.region.watch(pose[:2], self.reach, sleep.awake_links()[:2])
            truth = self._truth(pose)
            end = self._end(pose, tick)
            if end is not None or tick.record:
                self._wall_clock.look()
                models = {body.name: self._pose(body) for body in self.kept}
                self._recording.add(tick.time, pose, models)
                progress(tick.time, pose, models)
                notice.look(tick.time, pose[:3], truth.heading)
            if end is None:
                links = sleep.motion.places, sleep.motion.turns
                scan = lidar.scan(tick.time, pose, *links) if tick.lidar and lidar else None
                self.autonomy.sense(tick, truth, scan)
                end = self._command(tick) if tick.command else None
            if end is not None or tick.record:
                notice.feel(tick.time)
            if end is not None:
                return *end, tick.time
        raise AssertionError("the clock's last tick ends every run")

    def _end(self, pose: PoseRow, tick: Tick) -> End | None:
        """How the run ends if it ends at this tick, else None."""
        goal = self.scenario.goal
        if math.hypot(goal.x - pose[0], goal.y - pose[1]) <= goal.tolerance:
            return "pass", "", False
        if pose[2] < self.context.floor:
            return "failed", "fell", False
        if tick.step >= self.context.clock.last:
            return "failed", "", False
        if self.rest and tick.record and self.rest.update(tick.time, pose[:3], self._is_still()):
            return "failed", "", True
        return None

    def _is_still(self) -> bool:
        """Whether the controller has stopped for good, and no joint, no wheel and no model
        moves.
        """
        if not self.autonomy.is_over or self.sleep.pace.max(initial=0.0) > SLOW:
            return False
        speeds = self._state[self.context.built.plant.num_positions() :]
        return all(abs(speed) <= SLOW for speed in speeds)

    def _simulate(self, until: float) -> str:
        """Simulates up to the time `until` (s). Returns what went wrong, or ""."""
        try:
            self._simulator.AdvanceTo(until)
        # Drake raises SystemExit when one of its own checks fails.
        except (RuntimeError, ValueError, SystemExit) as error:
            if not self._look() or "nan" in str(error).lower():
                return "not-finite"
            if UNSOLVED in str(error):
                return self._unsolved()
            return (str(error).strip() or type(error).__name__).splitlines()[0]
        if self._look():
            return ""
        return "not-finite"

    def _unsolved(self) -> str:
        """What to say where the solver finds no contact forces: it fails where masses differ too
        much.
        """
        problem = "Drake found no contact forces; a smaller simulation.time_step may help"
        if not self.kept:
            return problem
        lightest = min(self.kept, key=_mass)
        return (
            f"{problem}; the lightest loose model, '{lightest.name}', has {_mass(lightest):.3g} kg"
        )

    def _command(self, tick: Tick) -> End | None:
        """Sets the wheel speeds that the controller wants. Returns how the run ends if the
        controller fails.
        """
        try:
            speeds = self.drive.wheel_speeds(
                self.autonomy.command(tick), self.scenario.controller.skid
            )
        except BadCode as failed:
            return "error", str(failed), False
        # Setting the same speeds again would only make Drake compute everything anew.
        if (self._commanded[len(speeds) :] != speeds).any():
            self._commanded[len(speeds) :] = speeds
            data: Any = self._motors.GetMutableData()
            data.get_mutable_value().SetFromVector(self._commanded)
        return None

    def _look(self) -> bool:
        """Reads the state as it is now. Returns whether it is finite."""
        self._state = self.sleep.state().tolist()
        # A sum of finite states does not overflow: none comes near the largest float.
        return math.isfinite(sum(self._state))

    def _pose(self, body: Body) -> PoseRow:
        """The pose of a model's first link in the world frame, as of the last look: x, y, z (m),
        qw, qx, qy, qz.
        """
        if body.base.is_floating_base_body():
            return self._floating(body.base.floating_positions_start())
        place = self.context.built.plant.EvalBodyPoseInWorld(self.context.plant_context, body.base)
        x, y, z = place.translation().tolist()
        qw, qx, qy, qz = place.rotation().ToQuaternion().wxyz().tolist()
        return x, y, z, qw, qx, qy, qz

    def _floating(self, start: int) -> PoseRow:
        # The plant's own quaternion: continuous, never jumping to its negative, but not exactly of
        # unit length.
        qw, qx, qy, qz, x, y, z = self._state[start : start + 7]
        length = math.hypot(qw, qx, qy, qz)
        return x, y, z, qw / length, qx / length, qy / length, qz / length

    def _truth(self, pose: PoseRow) -> Truth:
        """What the robot's sensors would measure without noise at its `pose`."""
        qw, qx, qy, qz = pose[3:]
        roll, pitch, heading = Pose(pose[:3], pose[3:]).rpy()
        # The gyro is fixed to the body: it measures the rotation about the body's own z axis, here
        # in the world frame.
        up_x = 2 * (qx * qz + qw * qy)
        up_y = 2 * (qy * qz - qw * qx)
        up_z = 1 - 2 * (qx * qx + qy * qy)
        wx, wy, wz = self._state[self._spin : self._spin + 3]
        wheels = tuple([sign * self._state[start] for start, sign in self._wheels])
        return Truth(heading, roll, pitch, up_x * wx + up_y * wy + up_z * wz, wheels)


def _mass(body: Body) -> float:
    return float(sum(link.default_mass() for link in body.links))
