"""Follows a run file: its events as they come, each with the states of the run before and after it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

from ddenv.runfile.fold import apply
from ddenv.runfile.state import RunState
from ddenv.runfile.store import Recorded, RunFile


def steps(events: Iterable[Recorded], state: RunState | None = None) -> Iterator[tuple[Recorded, RunState, RunState]]:
    """(event, before, after) for each event, from the beginning or from an earlier `state`. Raises UserError at an invalid one."""
    after = state or RunState()
    for recorded in events:
        before, after = after, apply(after, recorded)
        yield recorded, before, after


class Follower:
    """`state` is the one after the last event that was read and is valid."""

    def __init__(self, file: RunFile, state: RunState | None = None) -> None:
        self._file, self.state = file, state or RunState()

    def new(self, most: int = -1) -> Iterator[tuple[Recorded, RunState, RunState]]:
        """The events since then as `steps`, at most `most` unless that is negative. Raises UserError."""
        for recorded, before, after in steps(self._file.read(self.state.revision, most), self.state):
            self.state = after
            yield recorded, before, after
