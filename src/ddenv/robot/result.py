"""What one run returns, and how it is recorded while it goes on."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from ddenv.arrays import Floats
from ddenv.world.pose import Vector

# x, y, z (m), qw, qx, qy, qz.
PoseRow = tuple[float, float, float, float, float, float, float]
# Called while a run goes on, with the simulated time (s), the pose of the robot, and the poses of
# models that can move.
Progress = Callable[[float, PoseRow, Mapping[str, PoseRow]], None]


@dataclass(frozen=True, kw_only=True)
class RunResult:
    """One run of the robot.

    `outcome` is "pass" (goal reached), "failed" or "error" (the simulation broke). `failure` is
    empty for a pass, one of the words of `kind_of` for a failure, and for an error "not-finite" or
    the first line of Drake's message. `trajectory` (N, 8) has one row every 0.1 s and one at the
    end: t (s), x, y, z (m), qw, qx, qy, qz of the robot's first link in the world frame. `motions`
    holds such rows for each dynamic model that moved. `first_touched` maps a model to the time (s)
    when the robot first touched it, `first_sensed` to the time when it first had it in view or
    touched it, which is never later. Models that it never touched or sensed are absent. `cut` is
    True if the run was cut short: its controller had stopped, and it was at rest well inside or
    outside epsilon. `took_part` names the models that can have changed a bit of the run; None if
    that is unknown. A run with the same seed in a world that lacks others, and breaks no tie,
    repeats every bit of this one. Equal runs name the same models. `taken` names the finished run
    that implies this one, "" for a run that was made.
    """

    outcome: str
    failure: str
    trajectory: Floats
    motions: dict[str, Floats]
    simulated_seconds: float
    wall_seconds: float
    seed: int
    first_sensed: dict[str, float] = field(default_factory=dict)
    first_touched: dict[str, float] = field(default_factory=dict)
    cut: bool = False
    took_part: frozenset[str] | None = None
    taken: str = ""

    @property
    def end_pose(self) -> PoseRow:
        """The pose of the robot at the end: x, y, z (m), qw, qx, qy, qz."""
        x, y, z, qw, qx, qy, qz = self.trajectory[-1, 1:].tolist()
        return x, y, z, qw, qx, qy, qz


@dataclass(frozen=True)
class Ends:
    """Where the failures that count as f ended, m: all that a run has to know of f to end early.

    Without `suffice` a run that ends there still has to show that it came on a similar way.
    """

    positions: tuple[Vector, ...]
    epsilon: float
    suffice: bool = True

    def decide(self, place: Vector, slides: float) -> bool:
        """Whether failed runs that end within `slides` (m) of `place` all have the same verdict."""
        away = min(math.dist(place, position) for position in self.positions)
        return away - slides > self.epsilon or (self.suffice and away + slides < self.epsilon)


class Simulator(Protocol):
    """Runs the robot in parts of one world."""

    def run(
        self,
        keep: frozenset[str],
        seed: int,
        progress: Progress | None = None,
        ends: Ends | None = None,
    ) -> RunResult:
        """Runs the robot in the world with the models `keep`, and with those that always stay.

        `progress(time, pose, models)` gets the simulated time (s), and the poses (x, y, z in m, qw,
        qx, qy, qz) of the robot and, by name, of the models that can move, at each recorded sample.
        With `ends` a run may be cut short once the robot is at rest for good and its verdict by
        these is sure. Raises ValueError for unknown names.
        """
        ...


RECORD_PERIOD = 0.1  # s
# A model that moved less than this only settled on its contacts.
MOVED = 0.001  # m
TURNED = math.radians(0.5)


class Recording:
    """Poses of the robot, and of each moving model by name."""

    def __init__(self) -> None:
        self._robot: list[tuple[float, ...]] = []
        self._models: dict[str, list[tuple[float, ...]]] = {}

    def add(self, time_s: float, robot: PoseRow, models: dict[str, PoseRow]) -> None:
        """Adds one pose of each."""
        self._robot.append((time_s, *robot))
        for name, pose in models.items():
            self._models.setdefault(name, []).append((time_s, *pose))

    def trajectory(self) -> Floats:
        """The robot's poses, shape (N, 8): t (s), x, y, z (m), qw, qx, qy, qz."""
        return np.array(self._robot, dtype=float).reshape(-1, 8)

    def motions(self) -> dict[str, Floats]:
        """The poses of each model that moved, as in `trajectory`."""
        arrays = {name: np.array(rows) for name, rows in self._models.items()}
        return {name: rows for name, rows in arrays.items() if has_moved(rows)}


def has_moved(rows: Floats) -> bool:
    """Whether `rows` (N, 8) ever differ from their first pose by more than 1 mm or 0.5 degrees."""
    way = np.linalg.norm(rows[:, 1:4] - rows[0, 1:4], axis=1).max()
    # The quaternions q and -q are the same rotation.
    cosine = min(float(np.abs(rows[:, 4:] @ rows[0, 4:]).min()), 1.0)
    return bool(way > MOVED or 2 * math.acos(cosine) > TURNED)
