"""What the sensors say, as plain data."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ddenv.world.pose import Vector


class Imu(NamedTuple):
    """Turn rate about the robot's own vertical (rad/s), roll and pitch (rad)."""

    yaw_rate: float
    roll: float
    pitch: float


@dataclass(frozen=True, slots=True)
class Scan:
    """One turn of the lidar, taken at one instant.

    `angles` (N,) rad are the beams' directions in the robot's frame, counterclockwise from its x axis, `ranges` (N,) m how far
    they went, infinite where they met nothing. `origin` (m) is the lidar's place in the frame of the robot's first link.
    """

    time: float
    angles: np.ndarray
    ranges: np.ndarray
    origin: Vector

    def points(self) -> np.ndarray:
        """Where the beams ended that met something, shape (M, 3) m, in the frame of the robot's first link."""
        met = np.isfinite(self.ranges)
        ranges, angles = self.ranges[met], self.angles[met]
        x, y, z = self.origin
        return np.column_stack([x + ranges * np.cos(angles), y + ranges * np.sin(angles), np.full(len(ranges), z)])
