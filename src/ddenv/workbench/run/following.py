"""Reads a run file again and again for a screen, catches up with a long run, and keeps one candidate in sight for a while."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

from textual.screen import Screen

from ddenv.runfile.state import Candidate
from ddenv.workbench.shared.poll import Poll, Snapshot

# How often the run file is read, s.
PERIOD = 0.1
# While it catches up with a long run: the time to the next look, and the time between two updates of the screen, s.
AT_ONCE, CATCHING_UP = 0.002, 0.5
# The map stays with a candidate for at least this time, s.
CALM = 4.0


class Following:
    """Calls `seen(before, live)` after each look that found something new, and `show(changed)` when it is time to show it.

    `before` is the snapshot before that look. `live` is False while it catches up with a long run: its events are old.
    `changed` is False if only the time changed.
    """

    def __init__(
        self, screen: Screen[Any], poll: Poll, seen: Callable[[Snapshot, bool], None], show: Callable[[bool], None]
    ) -> None:
        self._screen, self._poll, self._seen, self._show = screen, poll, seen, show
        self._stale, self._coming = False, False
        self._shown = time.monotonic()
        # The round and the candidate that the map stays with, and until when.
        self._stays: tuple[tuple[int, int] | None, int, float] = (None, 0, 0.0)

    def begin(self) -> None:
        """Looks now, and then every `PERIOD`."""
        self.look()
        self._screen.set_interval(PERIOD, self.look)

    def look(self) -> None:
        """Reads what is new in the run file."""
        before, live = self._poll.snapshot, not self._poll.catching_up
        if self._poll.look() is not None:
            self._stale = True
            self._seen(before, live)
        if self._poll.catching_up and not self._coming:
            # Soon, but after the keys that were pressed meanwhile.
            self._coming = True
            self._screen.set_timer(AT_ONCE, self._look_on)
        if not self._poll.catching_up or time.monotonic() - self._shown >= CATCHING_UP:
            changed, self._stale = self._stale, False
            if changed:
                self._shown = time.monotonic()
            self._show(changed)

    def _look_on(self) -> None:
        self._coming = False
        self.look()

    @property
    def candidate(self) -> Candidate | None:
        """The candidate to show. However fast the current one changes, it stays for `CALM` seconds, so that it can be read."""
        snapshot, moment = self._poll.snapshot, time.monotonic()
        state, focus = snapshot.state, snapshot.focus
        round, index, until = self._stays
        now = (state.node, state.round.number) if state.round and not state.round.done else None
        waits = state.waiting_candidate is not None
        if state.round and now == round and moment < until and not waits and snapshot.engine == "alive":
            return state.round.candidates[index]
        if focus is not None and (now, focus.index) != (round, index):
            self._stays = now, focus.index, moment + CALM
        return focus
