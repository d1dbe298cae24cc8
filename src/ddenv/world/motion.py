"""Recorded motion: where something was at any instant between the rows of a recording."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from ddenv.world.pose import Pose


def pose_at(samples: np.ndarray, time: float) -> Pose:
    """The pose at simulated `time`, s, interpolated between rows (t, x, y, z, qw, qx, qy, qz) of `samples`."""
    after = int(np.clip(np.searchsorted(samples[:, 0], time), 1, max(1, len(samples) - 1)))
    if len(samples) == 1:
        return pose_of(samples[0, 1:])
    first, second = samples[after - 1], samples[after]
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
