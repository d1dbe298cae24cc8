"""A finished test as it is played back: where the robot and the models that moved were at any
instant, from the run file alone.
"""

from __future__ import annotations

from array import array
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from ddenv.errors import UserError
from ddenv.runfile.position import Position
from ddenv.runfile.state import Test
from ddenv.runfile.store import COLUMNS, ROBOT, RunFile
from ddenv.runfile.tested import purpose
from ddenv.runs.changes import changed_run
from ddenv.text import Names
from ddenv.world.pose import Pose, pose_at

# Time between two frames: a run file has a row of each motion so often, s.
FRAME = 0.1
# No test lasts longer, s, and nothing goes farther in one, m.
LONGEST = 1e6
FARTHEST = 1e6

ANOTHER_SIMULATOR = (
    "Another simulator made this run: only the robot's path is stored; models stay where they "
    "start."
)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Played:
    """A finished test. `words` say what it was made for; `models` were in it.

    `rows` are the robot's, flat rows of `COLUMNS` floats, empty if the run file lacks them;
    `moving` has those of each model that moved. `lacks` says in sentences what is missing.
    """

    test: Test
    words: str
    models: Names
    rows: array[float]
    moving: dict[str, np.ndarray]
    lacks: Names = ()

    @property
    def robot(self) -> np.ndarray:
        """The robot's rows, shape (N, 8): t (s), x, y, z (m), qw, qx, qy, qz."""
        return table(self.rows)

    @property
    def length(self) -> float:
        """How long the test lasted, simulated s."""
        if self.rows:
            return self.rows[-COLUMNS]
        return 0.0

    def pose(self, time: float) -> Pose | None:
        """Where the robot was at simulated `time`, s; None if that is not stored."""
        if self.rows:
            return pose_at(self.robot, time)
        return None


def played(file: RunFile, position: Position, number: int) -> Played:
    """The finished test with this number. Raises UserError if there is none; what the file lacks of
    it is said in `lacks`.
    """
    tests = position.end.tests
    if number < 0:
        _, test = changed_run(position.end, number)
    elif 0 < number <= len(tests):
        test = tests[number - 1]
    else:
        raise UserError(f"{file.path}: there is no test {number}")
    if not test.is_finished:
        why = "is still running" if test.outcome == "running" else "was lost"
        raise UserError(f"test {number} {why}: only a finished test is stored")
    if (position.end.scenario.get("oracle") or {}).get("command"):
        lacks = [ANOTHER_SIMULATOR]
    else:
        lacks = []
    try:
        start = position.start_of(number)
        words = purpose(position.end if start is None else start.after, test)
    except UserError:
        words = f"test {number}"
    rows = array("d")
    moving = {}
    for name, samples in _stored(file, number, lacks).items():
        stored = table(samples)
        times = stored[:, 0]
        in_time = (
            times.size
            and times[0] >= 0
            and times[-1] <= LONGEST
            and (times[:-1] <= times[1:]).all()
        )
        # No number compares with NaN.
        if not (in_time and (np.abs(stored) <= FARTHEST).all()):
            lacks.append(
                f"The motion of {name or 'the robot'} in test {number} is damaged: it stays "
                "where it starts."
            )
        elif name == ROBOT:
            rows = samples
        else:
            moving[name] = stored
    if rows:
        test = replace(test, simulated_seconds=test.simulated_seconds or rows[-COLUMNS])
    else:
        lacks.append(
            f"The run file has no path of the robot in test {number} (bundles leave paths out): "
            "nothing moves here."
        )
    return Played(
        test=test,
        words=words,
        models=position.end.models_of(test),
        rows=rows,
        moving=moving if rows else {},
        lacks=tuple(lacks),
    )


def _stored(file: RunFile, number: int, lacks: list[str]) -> dict[str, array[float]]:
    """All motions; where one of them cannot be read, the robot's alone if that can be."""
    try:
        return file.motions(number)
    except UserError as error:
        lacks.append(f"{error}.")
    with suppress(UserError):
        if (robot := file.motion(number)) is not None:
            return {ROBOT: robot}
    return {}


def table(samples: array[float]) -> np.ndarray:
    """Samples of a run file as rows (N, 8): t (s), x, y, z (m), qw, qx, qy, qz."""
    if samples:
        return np.frombuffer(samples, dtype=float).reshape(-1, COLUMNS)
    return np.zeros((0, COLUMNS))
