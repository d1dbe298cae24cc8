"""What is true in the simulation: poses and speeds read from the plant's context."""

from __future__ import annotations

import math

from pydrake.systems.framework import Context

from ddenv.robot.drive import Drive
from ddenv.robot.plant import Body, Built
from ddenv.robot.sensing.suite import Truth

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
