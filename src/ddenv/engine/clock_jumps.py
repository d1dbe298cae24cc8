"""Notices when Unix time does not go on evenly: the machine slept, or its clock was set."""

from __future__ import annotations

import time
from collections.abc import Callable

from ddenv.engine.journal import Journal
from ddenv.runfile.events import ClockJumped

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
            self._journal.record(ClockJumped(jump))
