"""What one run gives."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from ddenv.world.pose import Vector

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


# Is told the simulated time (s) and the robot's x, y, z (m), qw, qx, qy, qz while it runs.
Progress = Callable[[float, tuple[float, ...]], None]


@dataclass(frozen=True)
class RunResult:
    """One run of the robot.

    `outcome` is "pass" (goal reached), "failed" or "error" (the simulation broke). `failure` is empty for a pass, a word of
    `kind_of` for a failure, and for an error "not-finite" or the first line of what Drake said.
    `trajectory` has one row every 0.1 s and one at the end: t (s), x, y, z (m), qw, qx, qy, qz of the robot's first link in
    the world frame. `motions` holds the same for each dynamic model that moved.
    `first_sensed` and `first_touched` tell by name when (s) the robot first had a model in view or touched it, and when it
    first touched it; models that it never did are absent. Every model that was touched was sensed by then.
    `cut` says that the run was ended before its time because the robot was stuck for good.
    `taken` names the run that it was taken over from, "" where it was made.
    """

    outcome: str
    failure: str
    trajectory: np.ndarray
    motions: dict[str, np.ndarray]
    simulated_seconds: float
    wall_seconds: float
    seed: int
    first_sensed: dict[str, float] = field(default_factory=dict)
    first_touched: dict[str, float] = field(default_factory=dict)
    cut: bool = False
    taken: str = ""

    @property
    def end_pose(self) -> tuple[float, ...]:
        """x, y, z (m), qw, qx, qy, qz of the robot at the end."""
        return tuple(float(value) for value in self.trajectory[-1, 1:])

    @property
    def end_position(self) -> Vector:
        """x, y, z (m) of the robot at the end."""
        return self.end_pose[:3]
