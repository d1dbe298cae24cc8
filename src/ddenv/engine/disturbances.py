"""What disturbs an engine from outside: a disk without space, and a clock that does not go on evenly."""

from __future__ import annotations

import shutil
import sys
import threading
import time
from collections.abc import Callable
from contextlib import suppress

from ddenv.engine.journal import Journal
from ddenv.errors import UserError
from ddenv.runfile import events
from ddenv.runfile.store import NoRoom, RunFile

# What has to be free before a test starts, bytes: the results of tests in flight, and SQLite's log of them.
NEEDED = 32_000_000
# The time between two looks, s.
PERIOD = 1.0


class DiskSpace:
    """Watches the disk of a run file. `terminated` ends all waiting."""

    def __init__(self, file: RunFile, terminated: threading.Event) -> None:
        self._file = file
        self._terminated = terminated
        self._next = 0.0
        self._enough = True
        self._telling = False

    def enough(self) -> bool:
        """Whether a test may start. Writes an event when that changes."""
        if time.monotonic() >= self._next:
            self._next = time.monotonic() + PERIOD
            self._tell(self._free() >= NEEDED)
        return self._enough

    def wait(self, full: NoRoom) -> bool:
        """Waits for a moment; returns whether to try again what found no room."""
        if self._telling or self._terminated.is_set():
            return False
        if self._enough:
            # The log may be on the same disk.
            with suppress(OSError):
                print(f"{full}; waits until {NEEDED / 1e6:.0f} MB are free", file=sys.stderr, flush=True)
        self._tell(False)
        return not self._terminated.wait(PERIOD)

    def _tell(self, enough: bool) -> None:
        changed, self._enough = enough != self._enough, enough
        if not changed:
            return
        # A small event may find room where a result does not.
        self._telling = True
        with suppress(UserError):
            self._file.append(events.DiskSpace(enough, NEEDED, self._free()))
        self._telling = False

    def _free(self) -> int:
        return shutil.disk_usage(self._file.path.parent).free


# How far a clock that is kept exact may go on or back between two looks, s.
SMALL = 2.0


class ClockJumps:
    """Compares Unix time with a clock that stands still while the machine sleeps, and that nobody can set; both in s."""

    def __init__(
        self,
        journal: Journal,
        clock: Callable[[], float] = time.time,
        steady: Callable[[], float] = time.monotonic,
    ) -> None:
        self._journal = journal
        self._offset: Callable[[], float] = lambda: clock() - steady()
        self._last = self._offset()

    def look(self) -> None:
        """Records a jump since the last look: what is reckoned from the time that the run took would be wrong."""
        offset = self._offset()
        jump, self._last = offset - self._last, offset
        if abs(jump) > SMALL:
            self._journal.record(events.ClockJumped(jump))
