"""What is true in the simulation: poses and speeds read from the plant's context."""

from __future__ import annotations

import math

import numpy as np
from pydrake.systems.framework import Context

from ddenv.robot.drive import Drive
from ddenv.robot.plant import Body, Built
from ddenv.robot.sensors import Truth

PoseRow = tuple[float, ...]


class Observer:
    """Reads one context of the plant."""

    def __init__(self, built: Built, drive: Drive, plant_context: Context) -> None:
        self._plant = built.plant
        self._robot = built.robot
        self._drive = drive
        self._context = plant_context
        self._base_spin = built.robot.base.floating_velocities_start_in_v()
        joints = [built.plant.GetJointByName(name, built.robot.instance) for name in drive.joints]
        self._wheels = [joint.velocity_start() for joint in joints]

    def pose(self, body: Body) -> PoseRow:
        """x, y, z (m), qw, qx, qy, qz of the first link in the world frame."""
        if not body.base.is_floating_base_body():
            place = self._plant.EvalBodyPoseInWorld(self._context, body.base)
            return (*place.translation().tolist(), *place.rotation().ToQuaternion().wxyz().tolist())
        # As the plant holds it: continuous, never jumping to the opposite quaternion, but not quite of unit length.
        start = body.base.floating_positions_start()
        qw, qx, qy, qz, x, y, z = self._plant.GetPositions(self._context)[start : start + 7].tolist()
        length = math.hypot(qw, qx, qy, qz)
        return x, y, z, qw / length, qx / length, qy / length, qz / length

    def robot(self) -> PoseRow:
        """The pose of the robot."""
        return self.pose(self._robot)

    def truth(self) -> Truth:
        """What the robot's sensors would measure without noise."""
        x, y, _, qw, qx, qy, qz = self.robot()
        velocities = self._plant.GetVelocities(self._context).tolist()
        spin = velocities[self._base_spin : self._base_spin + 3]
        # The gyro is fixed to the body: it measures the turning about the body's own z axis, given here in the world frame.
        axis = (2 * (qx * qz + qw * qy), 2 * (qy * qz - qw * qx), 1 - 2 * (qx * qx + qy * qy))
        rate = sum(part * speed for part, speed in zip(axis, spin, strict=True))
        heading = math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz))
        return Truth(x, y, heading, rate, self._rim_speed(velocities, True), self._rim_speed(velocities, False))

    def is_finite(self) -> bool:
        """Whether the whole state of the plant still consists of numbers."""
        return bool(np.isfinite(self._plant.GetPositionsAndVelocities(self._context)).all())

    def _rim_speed(self, velocities: list[float], on_left: bool) -> float:
        sides = zip(self._wheels, self._drive.left, strict=True)
        speeds = [velocities[wheel] for wheel, is_left in sides if is_left == on_left]
        return self._drive.radius * sum(speeds) / len(speeds)
