"""Work that may wait, such as forecasts: done while tests run, and in a small part of the time."""

from __future__ import annotations

import time
from collections.abc import Iterator

# The part of all time that it may take; and besides that, s: at first, when most is unknown, and for each test that has ended.
SHARE, FIRST, AFTER_TEST = 0.01, 0.5, 0.002


class Background:
    """Advances `steps` of some milliseconds as long as there is time for them. What begins next takes the place of what is left."""

    def __init__(self) -> None:
        self._steps: Iterator[object] = iter(())
        self._began = time.monotonic()
        self._spent = 0.0
        self._ended = 0

    def begin(self, steps: Iterator[object]) -> None:
        """From now on advances `steps`."""
        self._steps = steps

    def test_ended(self) -> None:
        """A test has ended: some more time may be taken."""
        self._ended += 1

    def step(self) -> bool:
        """Makes one step; returns False where none is left, or no time for it."""
        began = time.monotonic()
        if self._spent > FIRST + AFTER_TEST * self._ended + SHARE * (began - self._began):
            return False
        made = next(self._steps, self) is not self
        self._spent += time.monotonic() - began
        return made
