"""The robot of a scenario in MuJoCo, with the sensors, the pose estimate and the controller that it
has in Drake.

simulator.yaml names the class MuJoCo. drive.py SCENARIO prints the MJCF. Needs ddenv-workbench and
`pip install mujoco`.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from mjcf import mjcf, named

from ddenv import Ended, SimulatorSetup, SubWorld
from ddenv.robot.clock import Clock
from ddenv.robot.controllers import controllers
from ddenv.robot.sensing.autonomy import Autonomy, SensorSuite, Truth, setup_of
from ddenv.robot.sensing.beams import Obstacles
from ddenv.robot.sensing.lidar import Lidar
from ddenv.world.drive import find_drive
from ddenv.world.load import load_scenario
from ddenv.world.placement import spawn_pose
from ddenv.world.pose import Pose
from ddenv.world.sdf.read import read_model, read_world
from ddenv.world.whole import whole_of

STEP = 0.002  # MuJoCo's time step at most, s: its contacts need shorter ones than Drake's


class Broken(Exception):
    """Why MuJoCo cannot go on, in one line."""


class Parts:
    """A scenario with what it names."""

    def __init__(self, file: Path) -> None:
        self.scenario = load_scenario(file)
        self.world = read_world(self.scenario.world, self.scenario.reading)
        self.robot = read_model(self.scenario.robot.model, self.scenario.reading)
        self.drive = find_drive(self.robot, self.scenario.robot.wheels)
        self.clock = Clock.of(self.scenario)
        # How many steps MuJoCo makes in one of the clock's.
        self.steps = math.ceil(self.clock.step / STEP - 1e-9)

    def text(self) -> str:
        start, gain = spawn_pose(self.scenario.robot.spawn), self.scenario.controller.motor_gain
        return mjcf(self.world, self.robot, start, self.drive, gain, self.clock.step / self.steps)


class Simulation:
    """MuJoCo with world and robot."""

    def __init__(self, parts: Parts) -> None:
        import mujoco

        # By default MuJoCo writes warnings to a file in the current folder, and starts again after
        # a number that is not finite.
        self._warnings: list[str] = []
        mujoco.set_mju_user_warning(self._warnings.append)
        self._advance, self._steps = mujoco.mj_step, parts.steps
        self._model = model = mujoco.MjModel.from_xml_string(parts.text())
        self._data = mujoco.MjData(model)
        mujoco.mj_forward(model, self._data)
        base = model.body(named(0, parts.robot.links[0].name)).id
        self._place = model.jnt_qposadr[model.body_jntadr[base]]
        self._spin = model.jnt_dofadr[model.body_jntadr[base]] + 3
        self._wheels = [model.joint(named(0, name)).dofadr[0] for name in parts.drive.joints]
        self._signs = np.array(parts.drive.signs)
        moving = [
            (number, each)
            for number, each in enumerate(parts.world.models, start=1)
            if not each.static
        ]
        self._links = [
            model.body(named(number, link.name)).id
            for number, each in moving
            for link in each.links
        ]

    def advance(self, steps: int, speeds: np.ndarray) -> None:
        """Simulates `steps` of the clock with the joint speeds that the wheels shall have, rad/s.
        Raises Broken.
        """
        self._data.ctrl[:] = speeds
        self._advance(self._model, self._data, nstep=steps * self._steps)
        if self._warnings:
            raise Broken(f"MuJoCo: {self._warnings[0]}")

    def pose(self) -> tuple[float, ...]:
        """Of the robot's first link: x, y, z (m), qw, qx, qy, qz."""
        return tuple(self._data.qpos[self._place : self._place + 7].tolist())

    def truth(self) -> Truth:
        """What ideal sensors of the robot measure."""
        x, y, z, *quaternion = self.pose()
        roll, pitch, heading = Pose((x, y, z), tuple(quaternion)).rpy()
        wheels = self._data.qvel[self._wheels] * self._signs
        return Truth(
            heading=heading,
            roll=roll,
            pitch=pitch,
            # MuJoCo gives the turn rate of a free body in the body's own axes.
            yaw_rate=float(self._data.qvel[self._spin + 2]),
            wheels=tuple(wheels.tolist()),
        )

    def links(self) -> tuple[np.ndarray, np.ndarray]:
        """Places (L, 3) m and rotations (L, 3, 3) of the links of all models that can move, in the
        order of the world.
        """
        return self._data.xpos[self._links].copy(), self._data.xmat[self._links].reshape(
            -1, 3, 3
        ).copy()


def drive(parts: Parts, seed: int) -> Iterator[tuple[float, tuple[float, ...]]]:
    """One run: yields time and pose of the robot, and returns how it ended. Raises Broken and
    BadCode.
    """
    scenario, world = parts.scenario, parts.world
    simulation, suite = Simulation(parts), SensorSuite(scenario.sensors, seed)
    setup = setup_of(parts.robot, parts.drive, parts.clock, scenario, seed)
    controller = controllers(scenario.controller, scenario.folder)(setup)
    autonomy = Autonomy(scenario, suite, parts.drive, parts.clock, controller)
    lidar = None
    if scenario.sensors.lidar is not None:
        names = frozenset(model.name for model in world.models)
        moving = [model for model in world.models if not model.static]
        lidar = Lidar(scenario.sensors.lidar, Obstacles.of(world), names, moving, suite.lidar)
    floor = whole_of(world, scenario).floor
    speeds, before, goal = np.zeros(len(parts.drive.joints)), 0, scenario.goal
    for tick in parts.clock.ticks:
        if tick.step > before:
            simulation.advance(tick.step - before, speeds)
            before = tick.step
        pose = simulation.pose()
        x, y, z, qw, qx, qy, qz = pose
        arrived = math.hypot(goal.x - x, goal.y - y) <= goal.tolerance
        ended = arrived or z < floor or tick.step == parts.clock.last
        if tick.record or ended:
            yield tick.time, (x, y, z, qx, qy, qz, qw)
        if ended:
            return Ended(arrived)
        scan = lidar.scan(tick.time, pose, *simulation.links()) if tick.lidar and lidar else None
        autonomy.sense(tick, simulation.truth(), scan)
        if tick.command:
            speeds = parts.drive.wheel_speeds(autonomy.command(tick), scenario.controller.skid)
    raise AssertionError("the clock's last tick ends every run")


class MuJoCo:
    """The simulator of simulator.yaml."""

    def __init__(self, setup: SimulatorSetup) -> None:
        # Once for all tests.
        import mujoco  # noqa: F401

    def run(
        self, world: SubWorld, seed: int, timeout: float
    ) -> Iterator[tuple[float, tuple[float, ...]]]:
        return drive(Parts(world.scenario), seed)


if __name__ == "__main__":
    print(Parts(Path(sys.argv[1])).text())
