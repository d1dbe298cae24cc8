"""Earlier moments of a run, as the run screen shows them."""

from __future__ import annotations

from array import array

from ddenv.errors import UserError
from ddenv.runfile.fold import spent
from ddenv.runfile.position import Moment, Position, Step
from ddenv.runfile.state import RunState
from ddenv.runfile.store import RunFile
from ddenv.runfile.tested import pointed
from ddenv.words.news import happened
from ddenv.workbench.shared.poll import Poll, Snapshot

# Why no key guides the run meanwhile.
NOT_NOW = "this is an earlier moment of the run: escape comes back to now"
NO_MORE = {
    "moment": "the run begins here",
    "round": "there is no round before this one",
    "reduction": "there is no reduction before this moment",
    "decision": "there is no verdict before this moment",
}
# Paths of tests that are kept.
PATHS = 16


class Browsing:
    """Where in the run the screen is: at its end, where it follows the run, or at an earlier moment."""

    def __init__(self, poll: Poll) -> None:
        self._poll = poll
        self.position = Position(poll.file.events)
        self._moments = Moments(poll.file)
        self._shown: tuple[int | None, Snapshot] = (None, Snapshot())

    @property
    def is_past(self) -> bool:
        """Whether an earlier moment is shown."""
        return self.position.at is not None

    def step(self, what: Step, by: int) -> str:
        """Goes on or back. Returns why that is not possible, or "". Raises UserError for a damaged file."""
        if self.position.step(what, by):
            return ""
        return NO_MORE[what] if by < 0 else "this is now already"

    def go(self, id: int | None) -> str:
        """Goes to the moment of an event, or to the end, as `step` does."""
        self.position.go(id)
        return ""

    @property
    def snapshot(self) -> Snapshot:
        """What the screen shows. Raises UserError if the file cannot be read any more."""
        at = self.position.at
        if at is None:
            return self._poll.snapshot
        if self._shown[0] != at:
            moment = self.position.moment(at)
            self._shown = at, Snapshot() if moment is None else self._moments.of(moment, happened(moment))
        return self._shown[1]


class Moments:
    """Snapshots of moments of a run, with the paths that their maps show."""

    def __init__(self, file: RunFile) -> None:
        self._file = file
        self._paths: dict[int, array[float] | None] = {}

    def of(self, moment: Moment, words: str) -> Snapshot:
        """The snapshot of a moment in which happened what the `words` say."""
        state = moment.after
        first = state.f_test.id if state.f_test is not None else None
        return Snapshot(
            state,
            evidence=self.path(state.evidence_test),
            spent=_spent(state),
            original=self.path(first),
            past=True,
            pointed=pointed(moment),
            happened=words,
        )

    def path(self, test: int | None) -> array[float] | None:
        """The robot's path in a test, as rows of `COLUMNS`; None if it is not recorded."""
        if test is None:
            return None
        if test not in self._paths:
            while len(self._paths) >= PATHS:
                del self._paths[next(iter(self._paths))]
            try:
                self._paths[test] = self._file.motion(test)
            except UserError:
                # The map is good for much without it.
                return None
        return self._paths[test]


def _spent(state: RunState) -> int:
    """Time that engines had worked by then, s."""
    return int(spent(state, state.updated_at))
