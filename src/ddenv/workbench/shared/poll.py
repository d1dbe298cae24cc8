"""Reads a run file again and again, and returns what changed."""

from __future__ import annotations

import math
import time
from array import array
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from ddenv import __version__
from ddenv.errors import UserError
from ddenv.runfile.lock import engine_is_alive
from ddenv.runfile.snapshot import EngineIs, Snapshot
from ddenv.runfile.state import RunState, spent
from ddenv.runfile.store import COLUMNS, Live
from ddenv.workbench.shared.observed import Busy, Gone, Observed

# How often the lock is tried: a look holds it for an instant, so not at every tick, s.
LOCK_PERIOD = 0.5
# How often the poses of running tests are read: more often would only send more to the terminal, s.
LIVE_PERIOD = 0.25
# Maximum time of a look, s, and number of events read at a time: keys are answered even while a
# long run is read.
PATIENCE = 0.015
SOME_EVENTS = 50


def now() -> float:
    """Unix time, s."""
    return time.time()


class Poll:
    """One open run file, which is only ever read.

    `starting` says whether an engine was started that may not hold the lock yet. With `watch`
    nothing is written. `on_event` is called once with each event's kind and the states before and
    after it.
    """

    def __init__(
        self,
        path: Path,
        *,
        starting: Callable[[], bool] = lambda: False,
        watch: bool = False,
        on_event: Callable[[str, RunState, RunState], None] = lambda kind, before, after: None,
    ) -> None:
        """Raises UserError for a file that is no run file."""
        self.path = path
        self.watch = watch
        self._on_event = on_event
        self.file = Observed(path, strictly=watch)
        self._state = RunState()
        self._starting = starting
        self._snapshot: Snapshot | None = None
        self._behind = self._catching_up = True
        self._looked = -math.inf
        self._alive = False
        self._posed = -math.inf
        self._motions: dict[int, array[float] | None] = {}

    @property
    def snapshot(self) -> Snapshot:
        return self._snapshot or Snapshot()

    @property
    def catching_up(self) -> bool:
        return self._catching_up

    def close(self) -> None:
        """Closes the file; the last one to do so folds its log back."""
        if self.watch:
            self.file.close()
            return
        with suppress(UserError):
            self.file.tidy()

    def look(self) -> Snapshot | None:
        """The new snapshot, or None if nothing changed since the last look, or another program is
        writing.
        """
        try:
            self._behind = self.file.refresh() or self._behind
            snapshot = self._read()
        except Busy:
            return None
        except UserError as error:
            self._behind = True
            snapshot = replace(self.snapshot, error=str(error))
            if isinstance(error, Gone):
                why = f"{error}; the screen shows what was read last"
                snapshot = replace(snapshot, engine="absent", live=(), error=why, gone=True)
        if snapshot == self._snapshot:
            return None
        self._snapshot = snapshot
        return snapshot

    def _read(self) -> Snapshot:
        """Reads as much as makes sense of a damaged file, with what is wrong. Raises Busy."""
        engine = self._engine()
        last = self._snapshot
        if last is not None and not self._behind:
            # The time goes on.
            spent = self._spent(engine)
            if (engine, spent) == (last.engine, last.spent):
                return last
            return replace(last, engine=engine, spent=spent)
        error, more = self._follow()
        state = self._state
        spent = self._spent(engine)
        try:
            live, due = self._poses(state) if engine == "alive" else ((), True)
            # The robot's paths on the last similar run and in f, each read once.
            ways = (state.evidence_test, None if state.f_test is None else state.f_test.id)
            known = self._motions
            self._motions = {
                test: known[test] if test in known else self.file.motion(test)
                for test in ways
                if test
            }
            evidence, original = (self._motions.get(test or 0) for test in ways)
            snapshot = Snapshot(
                state=state,
                live=live,
                engine=engine,
                evidence=evidence,
                spent=spent,
                error=error,
                original=original,
            )
        except Busy:
            raise
        except UserError as trouble:
            snapshot = Snapshot(
                state=state,
                live=(),
                engine=engine,
                evidence=None,
                spent=spent,
                error=error or str(trouble),
            )
            due = True
        self._behind = more or not due
        self._catching_up = more
        return replace(snapshot, behind=more, version=__version__)

    def _follow(self) -> tuple[str, bool]:
        """Reads new events up to the first invalid one; what is wrong with that, and whether there
        are more. Raises Busy.
        """
        from ddenv.runfile.fold import steps

        begun = time.monotonic()
        more = True
        try:
            while more:
                more = False
                for event, before, after in steps(
                    self.file.read(self._state.revision, SOME_EVENTS), self._state
                ):
                    self._state = after
                    self._on_event(event.kind, before, after)
                    more = True
                if time.monotonic() - begun > PATIENCE:
                    break
        except Busy:
            raise
        except UserError as error:
            return str(error), False
        return "", more

    def _engine(self) -> EngineIs:
        moment = time.monotonic()
        if moment - self._looked >= LOCK_PERIOD:
            alive = engine_is_alive(self.path)
            # Rows of running tests are read only while an engine is there.
            self._behind = self._behind or alive != self._alive
            self._looked = moment
            self._alive = alive
        if self._alive:
            return "alive"
        if self._starting():
            return "starting"
        return "absent"

    def _poses(self, state: RunState) -> tuple[tuple[Live, ...], bool]:
        """Where the robots are, and whether that was read just now. Valid rows name a test and have
        a whole, finite pose.
        """
        moment = time.monotonic()
        if self._snapshot is not None and moment - self._posed < LIVE_PERIOD:
            running = {test.id for test in state.running_tests}
            return tuple(row for row in self._snapshot.live if row.test in running), False
        self._posed = moment
        try:
            rows = self.file.live()
            known = (
                row
                for row in rows
                if 0 < row.test <= len(state.tests) and len(row.pose) == COLUMNS - 1
            )
            return tuple(
                row for row in known if all(map(math.isfinite, (row.time, *row.pose)))
            ), True
        except (TypeError, ValueError):
            raise UserError(
                f"{self.path}: damaged run file: the pose of a running test is invalid"
            ) from None

    def _spent(self, engine: EngineIs) -> int:
        return int(spent(self._state, now() if engine == "alive" else self._state.updated_at))
