"""What a map shows of finished tests: the robots' ways, and the models of one or two of them."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import PersistentTuple, Round, RunState, Split, Trial
from ddenv.runfile.supports import Names
from ddenv.runs.playback import Played
from ddenv.workbench.map.place import Way


class RobotWay:
    """The robot's way in a test, made once, for any instant of it."""

    def __init__(self, one: Played, name: str) -> None:
        self._one, self._name = one, name
        self._rows = one.robot
        self.points = np.ascontiguousarray(self._rows[:, 1:3])

    @property
    def whole(self) -> Way:
        return Way(self._name, self.points)

    def at(self, time: float) -> Way:
        """The way with the robot where it was at simulated `time`, s."""
        pose = self._one.pose(time)
        if pose is None:
            return self.whole
        gone = int(np.searchsorted(self._rows[:, 0], time, side="right"))
        return Way(self._name, self.points, (*pose.position[:2], pose.yaw()), gone)

    def place(self, time: float) -> tuple[float, float] | None:
        pose = self._one.pose(time)
        return None if pose is None else pose.position[:2]


def snapshot_with(state: RunState, there: Names, groups: tuple[Names, ...]) -> Snapshot:
    """The run as if these models were its environment, and these `groups` the parts of its round, each with a letter."""
    round = Round(0, len(groups), Split(there, groups), PersistentTuple()) if groups else None
    bare = state.changed(environment=there, round=round, trials=(), pinned=frozenset(), supports=())
    return Snapshot(bare, past=True)


def without(there: Names, gone: Iterable[str]) -> Trial:
    """What the map takes for a candidate: the others of these models stand back, in small letters."""
    missing = frozenset(gone)
    return Trial(0, tuple(name for name in there if name not in missing), 0)
