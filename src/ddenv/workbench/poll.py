"""Looks at a run file again and again, and says when something changed."""

from __future__ import annotations

import math
import time
from array import array
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from ddenv.errors import UserError
from ddenv.runfile.fold import apply
from ddenv.runfile.lock import engine_is_alive
from ddenv.runfile.state import Candidate, RunState, Test
from ddenv.runfile.store import COLUMNS, Live, RunFile

# How often the lock is tried: a look holds it for an instant, so not at every tick, s.
LOCK_PERIOD = 0.5


def now() -> float:
    """Unix time, s."""
    return time.time()


@dataclass(frozen=True, slots=True)
class Snapshot:
    """All that the run screen shows at one moment.

    `engine` is "alive", "starting" or "absent". `evidence` is the robot's path on the last similar run, flat rows of
    `COLUMNS` floats. `spent` is the time engines have worked on the run, s. `error` says why the run file cannot be read.
    """

    state: RunState = field(default_factory=RunState)
    live: tuple[Live, ...] = ()
    engine: str = "absent"
    evidence: array | None = None
    spent: int = 0
    error: str = ""

    @property
    def status(self) -> str:
        """The state's status, or "starting" or "lost" where the engine's own state tells more."""
        if self.engine == "starting":
            return "starting"
        if self.state.ended or self.engine == "alive" or self.state.status == "created":
            return self.state.status
        return "lost"

    @property
    def running(self) -> tuple[Test, ...]:
        """The tests that run now, in the order they were started; none when no engine is there to run them."""
        if self.engine != "alive":
            return ()
        return self.state.running_tests

    @property
    def focus(self) -> Candidate | None:
        """The candidate that all is about now: the one that waits, or else the first one that is being tested."""
        current = self.state.round
        if current is None or current.done or self.status in ("finished", "lost"):
            return None
        if self.state.waiting_candidate is not None:
            return current.candidates[self.state.waiting_candidate]
        for test in self.running:
            if test.phase == "round" and test.round == current.number:
                return current.candidates[test.candidate]
        return None

    def seconds(self, test: int) -> float | None:
        """How far a running test is, simulated s."""
        return next((live.time for live in self.live if live.test == test), None)


class Poll:
    """One open run file. `starting` says whether an engine was started that may not hold the lock yet."""

    def __init__(
        self,
        path: Path,
        *,
        starting: Callable[[], bool] = lambda: False,
    ) -> None:
        """Raises UserError for a file that is no run file."""
        self.path = path
        self.file = RunFile(path)
        self._starting = starting
        self._snapshot: Snapshot | None = None
        self._looked = -math.inf
        self._alive = False
        self._evidence: tuple[int | None, array | None] = (None, None)

    def close(self) -> None:
        self.file.close()

    def look(self) -> Snapshot | None:
        """The new snapshot, or None if nothing changed since the last look."""
        snapshot = self._read()
        if snapshot == self._snapshot:
            return None
        self._snapshot = snapshot
        return snapshot

    def _read(self) -> Snapshot:
        """Of a damaged file as much as makes sense is shown, with what is wrong."""
        state, error = self._fold(self._snapshot.state if self._snapshot else RunState())
        engine = self._engine()
        spent = self._spent(state, engine)
        try:
            live = self._live(state) if engine == "alive" else ()
            return Snapshot(state, live, engine, self._motion(state), spent, error)
        except UserError as trouble:
            return Snapshot(state, (), engine, None, spent, error or str(trouble))

    def _fold(self, state: RunState) -> tuple[RunState, str]:
        """The state after the new events, up to the first one that makes no sense."""
        try:
            for event in self.file.events(after=state.revision):
                state = apply(state, event)
        except UserError as error:
            return state, str(error)
        return state, ""

    def _engine(self) -> str:
        moment = time.monotonic()
        if moment - self._looked >= LOCK_PERIOD:
            self._looked, self._alive = moment, engine_is_alive(self.path)
        if self._alive:
            return "alive"
        return "starting" if self._starting() else "absent"

    def _live(self, state: RunState) -> tuple[Live, ...]:
        """Only what makes sense: a row names a running test and has a whole, finite pose."""
        try:
            rows = self.file.live()
            return tuple(row for row in rows if 0 < row.test <= len(state.tests) and _finite(row))
        except (TypeError, ValueError):
            raise UserError(f"{self.path}: damaged run file: a running test's pose makes no sense") from None

    def _motion(self, state: RunState) -> array | None:
        test = state.evidence_test
        if test != self._evidence[0]:
            self._evidence = (test, None if test is None else self.file.motion(test))
        return self._evidence[1]

    def _spent(self, state: RunState, engine: str) -> int:
        if state.started_at is None:
            return int(state.working_seconds)
        until = now() if engine == "alive" else state.updated_at
        return int(state.working_seconds + max(0.0, until - state.started_at))


def _finite(row: Live) -> bool:
    return len(row.pose) == COLUMNS - 1 and all(math.isfinite(value) for value in (row.time, *row.pose))
