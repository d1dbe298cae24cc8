"""Rigid poses and vectors as plain data, in SDF's convention; and the pose at any instant of a
recorded motion.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import numpy as np

# x and y of a place, or of a vector.
Point = tuple[float, float]
Vector = tuple[float, float, float]


@dataclass(frozen=True, slots=True)
class Pose:
    """A rigid transform: position (x, y, z) in m and unit quaternion (w, x, y, z).

    `a @ b` is the pose of b's frame seen from a's parent, as with homogeneous matrices.
    """

    position: Vector = (0.0, 0.0, 0.0)
    quaternion: tuple[float, float, float, float] = (1.0, 0.0, 0.0, 0.0)

    @classmethod
    def from_rpy(cls, x: float, y: float, z: float, roll: float, pitch: float, yaw: float) -> Pose:
        """SDF's `x y z roll pitch yaw`: m and rad, rotations about the fixed x, then y, then z
        axis.
        """
        cr = math.cos(roll / 2)
        sr = math.sin(roll / 2)
        cp = math.cos(pitch / 2)
        sp = math.sin(pitch / 2)
        cy = math.cos(yaw / 2)
        sy = math.sin(yaw / 2)
        quaternion = (
            cr * cp * cy + sr * sp * sy,
            sr * cp * cy - cr * sp * sy,
            cr * sp * cy + sr * cp * sy,
            cr * cp * sy - sr * sp * cy,
        )
        return cls((x, y, z), quaternion)

    def rotation(self) -> np.ndarray:
        """Rotation matrix, shape (3, 3)."""
        # Loaded late: the first paint of the workbench does without it.
        import numpy as np

        w, x, y, z = self.quaternion
        return np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )

    def rotate(self, vector: Vector) -> Vector:
        """`vector`, given in this frame, expressed in the parent's axes."""
        w, x, y, z = self.quaternion
        vx, vy, vz = vector
        tx = 2 * (y * vz - z * vy)
        ty = 2 * (z * vx - x * vz)
        tz = 2 * (x * vy - y * vx)
        return (
            vx + w * tx + y * tz - z * ty,
            vy + w * ty + z * tx - x * tz,
            vz + w * tz + x * ty - y * tx,
        )

    def yaw(self) -> float:
        """Heading about the vertical axis, rad in (-pi, pi]."""
        return heading(self.quaternion)

    def rpy(self) -> Vector:
        """SDF's roll, pitch and yaw, rad. Where x points straight up or down, only yaw turns."""
        w, x, y, z = self.quaternion
        sine = 2 * (w * y - z * x)
        if abs(sine) > 1 - 1e-12:
            yaw = math.atan2(2 * (w * z - x * y), 1 - 2 * (x * x + z * z))
            return 0.0, math.copysign(math.pi / 2, sine), yaw
        return math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)), math.asin(sine), self.yaw()

    def inverse(self) -> Pose:
        w, x, y, z = self.quaternion
        turn = Pose((0.0, 0.0, 0.0), (w, -x, -y, -z))
        px, py, pz = turn.rotate(self.position)
        return Pose((-px, -py, -pz), turn.quaternion)

    def __matmul__(self, other: Pose) -> Pose:
        px, py, pz = self.rotate(other.position)
        aw, ax, ay, az = self.quaternion
        bw, bx, by, bz = other.quaternion
        quaternion = (
            aw * bw - ax * bx - ay * by - az * bz,
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
        )
        x, y, z = self.position
        return Pose((x + px, y + py, z + pz), quaternion)


def heading(quaternion: Sequence[float]) -> float:
    """The yaw of a quaternion w, x, y, z: its turn about the vertical axis, rad in (-pi, pi]."""
    w, x, y, z = quaternion
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def headings(quaternions: np.ndarray) -> np.ndarray:
    """The yaws (N,) of quaternions (N, 4), as `heading`."""
    import numpy as np

    w, x, y, z = quaternions.T
    return np.asarray(np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z)))


def angle_between(one: Sequence[float], other: Sequence[float]) -> float:
    """The angle of the rotation between two unit quaternions, rad; q and -q are the same
    rotation.
    """
    likeness = abs(sum([a * b for a, b in zip(one, other, strict=True)]))
    return 2.0 * math.acos(min(1.0, likeness))


def wrap(angle: float) -> float:
    """`angle` (rad), wrapped into [-pi, pi]."""
    return math.remainder(angle, math.tau)


def pointing(axis: Vector) -> Pose:
    """The shortest rotation from the z axis to the unit vector `axis`."""
    x, y, z = axis
    w = math.sqrt(max(0.0, 1.0 + z) / 2)
    if w < 1e-6:
        return Pose(quaternion=(0.0, 1.0, 0.0, 0.0))
    return Pose(quaternion=(w, -y / (2 * w), x / (2 * w), 0.0))


def turn(axis: Vector, angle: float) -> Pose:
    """The rotation by `angle`, rad, about the unit vector `axis`."""
    x, y, z = axis
    sine = math.sin(angle / 2)
    return Pose(quaternion=(math.cos(angle / 2), x * sine, y * sine, z * sine))


def vector(values: Iterable[float]) -> Vector:
    """Three numbers, such as a row of an array, as a plain vector."""
    x, y, z = values
    return float(x), float(y), float(z)


HERE = Pose()
ONE: Vector = (1.0, 1.0, 1.0)


def pose_at(samples: np.ndarray, time: float) -> Pose:
    """The pose at simulated `time`, s, interpolated between rows (t, x, y, z, qw, qx, qy, qz) of
    `samples`.
    """
    import numpy as np

    after = int(np.clip(np.searchsorted(samples[:, 0], time), 1, max(1, len(samples) - 1)))
    if len(samples) == 1:
        return pose_of(samples[0, 1:])
    first = samples[after - 1]
    second = samples[after]
    span = second[0] - first[0]
    part = float(np.clip((time - first[0]) / span, 0.0, 1.0)) if span > 0 else 1.0
    # Of the two quaternions of a rotation, the one on the same side gives the shorter path.
    sign = -1.0 if first[4:] @ second[4:] < 0 else 1.0
    quaternion = (1 - part) * first[4:] + part * sign * second[4:]
    return pose_of(np.concatenate([(1 - part) * first[1:4] + part * second[1:4], quaternion]))


def pose_of(values: Iterable[float]) -> Pose:
    """The pose of x, y, z, m, and a quaternion w, x, y, z of any length."""
    x, y, z, *quaternion = map(float, values)
    length = math.hypot(*quaternion) or 1.0
    w, i, j, k = (part / length for part in quaternion)
    return Pose((x, y, z), (w, i, j, k))
