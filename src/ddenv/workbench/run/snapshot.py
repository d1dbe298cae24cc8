"""Which moment the run screen shows: the run as it is read again and again, or an earlier one."""

from __future__ import annotations

import time
from array import array
from collections.abc import Callable
from functools import lru_cache
from typing import Any

from textual.screen import Screen

from ddenv.errors import UserError
from ddenv.runfile.position import Moment, Position, Step
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import Candidate, spent
from ddenv.runfile.store import RunFile
from ddenv.runfile.tested import pointed
from ddenv.workbench.shared.poll import Poll

# Why no key guides the run at an earlier moment.
NOT_NOW = "this is an earlier moment of the run: escape comes back to now"
# Paths of tests that are kept.
PATHS = 16
# How often the run file is read, s.
PERIOD = 0.1
# While it catches up with a long run: the time to the next look, and the time between two updates of the screen, s.
AT_ONCE, CATCHING_UP = 0.002, 0.5
# The map stays with a candidate for at least this time, s.
CALM = 4.0


class Browsing:
    """Where in the run the screen is: at its end, where it follows the run, or at an earlier moment."""

    def __init__(self, poll: Poll) -> None:
        self._poll = poll
        self.position = Position(poll.file.events)
        self._moments = Moments(poll.file)
        self._shown: tuple[int | None, Snapshot] = (None, Snapshot())

    @property
    def is_past(self) -> bool:
        return self.position.at is not None

    def step(self, what: Step, by: int) -> str:
        """Goes on or back. Returns why that is not possible, or "". Raises UserError for a damaged file."""
        if self.position.step(what, by):
            return ""
        return f"there is no {what} before this moment" if by < 0 else "this is now already"

    @property
    def snapshot(self) -> Snapshot:
        """What the screen shows. Raises UserError if the file cannot be read any more."""
        at = self.position.at
        if at is None:
            return self._poll.snapshot
        if self._shown[0] != at:
            from ddenv.words.news import happened

            moment = self.position.moment(at)
            self._shown = at, Snapshot() if moment is None else self._moments.of(moment, happened(moment))
        return self._shown[1]


class Moments:
    """Snapshots of moments of a run, with the paths that their maps show."""

    def __init__(self, file: RunFile) -> None:
        self._motion = lru_cache(PATHS)(file.motion)

    def of(self, moment: Moment, words: str) -> Snapshot:
        state = moment.after
        return Snapshot(
            state,
            evidence=self.path(state.evidence_test),
            spent=int(spent(state, state.updated_at)),
            original=self.path(None if state.f_test is None else state.f_test.id),
            past=True,
            pointed=pointed(moment),
            happened=words,
        )

    def path(self, test: int | None) -> array[float] | None:
        """The robot's path in a test, as rows of `COLUMNS`; None if it is not recorded: the map is good for much without it."""
        try:
            return None if test is None else self._motion(test)
        except UserError:
            return None


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
        self.look()
        self._screen.set_interval(PERIOD, self.look)

    def look(self) -> None:
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
