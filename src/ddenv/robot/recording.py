"""Where everything was during a run, a row every 0.1 s."""

from __future__ import annotations

import math

import numpy as np

RECORD_PERIOD = 0.1  # s
# A model that moved less than this stayed where it was: contacts settle.
MOVED = 0.001  # m
TURNED = math.radians(0.5)


class Recording:
    """Rows of t (s), x, y, z (m), qw, qx, qy, qz: of the robot, and of each moving model by name."""

    def __init__(self) -> None:
        self._robot: list[tuple[float, ...]] = []
        self._models: dict[str, list[tuple[float, ...]]] = {}

    def add(self, time_s: float, robot: tuple[float, ...], models: dict[str, tuple[float, ...]]) -> None:
        """One row for each."""
        self._robot.append((time_s, *robot))
        for name, pose in models.items():
            self._models.setdefault(name, []).append((time_s, *pose))

    def trajectory(self) -> np.ndarray:
        """The robot's rows, shape (N, 8)."""
        return np.array(self._robot, dtype=float).reshape(-1, 8)

    def motions(self) -> dict[str, np.ndarray]:
        """The rows of each model that moved, shape (N, 8)."""
        arrays = {name: np.array(rows) for name, rows in self._models.items()}
        return {name: rows for name, rows in arrays.items() if has_moved(rows)}


def has_moved(rows: np.ndarray) -> bool:
    """Whether `rows` (N, 8) ever leave their first pose by more than 1 mm or 0.5 degrees."""
    way = np.linalg.norm(rows[:, 1:4] - rows[0, 1:4], axis=1).max()
    # The quaternions q and -q are the same turn.
    cosine = min(float(np.abs(rows[:, 4:] @ rows[0, 4:]).min()), 1.0)
    return bool(way > MOVED or 2 * math.acos(cosine) > TURNED)
