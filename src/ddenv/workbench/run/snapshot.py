"""Which moment the run screen shows: the run as it is read again and again, or an earlier one."""

from __future__ import annotations

from array import array
from functools import lru_cache

from ddenv.errors import UserError
from ddenv.runfile.position import Moment, Position, Step
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.state import spent
from ddenv.runfile.store import RunFile
from ddenv.runfile.tested import pointed
from ddenv.workbench.shared.poll import Poll

# Why no key guides the run at an earlier moment.
NOT_NOW = "this is an earlier moment of the run: escape comes back to now"
# Paths of tests that are kept.
PATHS = 16


class Browsing:
    """Where in the run the screen is: at its end, where it follows the run, or at an earlier
    moment.
    """

    def __init__(self, poll: Poll) -> None:
        self._poll = poll
        self._moments = Moments(poll.file)
        self.position = Position(poll.file.events)
        self._shown: tuple[int | None, Snapshot] = (None, Snapshot())

    @property
    def is_past(self) -> bool:
        return self.position.at is not None

    def step(self, what: Step, by: int) -> str:
        """Goes on or back. Returns why that is not possible, or "". Raises UserError for a damaged
        file.
        """
        if self.position.step(what, by):
            return ""
        if by < 0:
            return f"there is no {what} before this moment"
        return "this is now already"

    @property
    def snapshot(self) -> Snapshot:
        """What the screen shows. Raises UserError if the file cannot be read any more."""
        at = self.position.at
        if at is None:
            return self._poll.snapshot
        if self._shown[0] != at:
            from ddenv.words.news import happened

            moment = self.position.moment(at)
            self._shown = (
                at,
                Snapshot() if moment is None else self._moments.of(moment, happened(moment)),
            )
        return self._shown[1]


class Moments:
    """Snapshots of moments of a run, with the paths that their maps show."""

    def __init__(self, file: RunFile) -> None:
        self._motion = lru_cache(PATHS)(file.motion)

    def of(self, moment: Moment, words: str) -> Snapshot:
        state = moment.after
        return Snapshot(
            state=state,
            evidence=self.path(state.evidence_test),
            spent=int(spent(state, state.updated_at)),
            original=self.path(None if state.f_test is None else state.f_test.id),
            past=True,
            pointed=pointed(moment),
            happened=words,
        )

    def path(self, test: int | None) -> array[float] | None:
        """The robot's path in a test, as rows of `COLUMNS`; None if it is not recorded: the map is
        good for much without it.
        """
        try:
            if test is None:
                return None
            return self._motion(test)
        except UserError:
            return None
