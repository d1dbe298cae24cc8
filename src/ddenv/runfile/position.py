"""A position in the events of a run: at its end, or at any earlier moment. Views, playback and
lessons move it alike.
"""

from __future__ import annotations

from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import takewhile
from typing import Literal, get_args

from ddenv.runfile.state import RunState
from ddenv.runfile.store import Recorded

# What a step goes to: the next event that a viewer sees; the end of the next chapter; the next
# reduction; the next verdict or decision of the user.
ChapterKind = Literal["baseline", "round", "certificate"]
Step = Literal["moment", "round", "reduction", "decision"]
# A state is kept of one in so many events.
GAP = 256
# These change nothing that a viewer sees.
_UNSEEN = {
    "command_handled",
    "command_refused",
    "environment_named",
    "forecast",
    "round_finished",
    "leg_started",
    "comparing",
}
_VERDICTS = ("candidate_judged", "trial_judged", "certificate_finished")


@dataclass(frozen=True, slots=True, kw_only=True)
class Chapter:
    """The baseline, a round or a certificate: `kind` with its `number`. It has events from `first`
    to `last`, begins with `models` and ends with `left` of them. `tests` were finished when it
    began.
    """

    kind: ChapterKind
    number: int
    first: int
    last: int
    models: int
    left: int
    tests: int


@dataclass(frozen=True, slots=True)
class Moment:
    """An event, with the states before and after it."""

    recorded: Recorded
    before: RunState
    after: RunState


class Position:
    """Finds the state at any event quickly, from states that it keeps of some of them. `read(after,
    most)` returns events with an id above `after`, as `RunFile.events` does. Each event is noted
    once, in order: by the one who folds them, or by `catch_up`. Event ids stand for positions; `at`
    is None at the end, also while it grows.
    """

    def __init__(self, read: Callable[[int, int], list[Recorded]]) -> None:
        self._read = read
        self.at: int | None = None
        self.end = RunState()
        self.chapters: list[Chapter] = []
        self._kept: list[RunState] = [self.end]
        self._ids = array("q", [0])
        # The events that started the tests, by the tests' ids less one.
        self._starts = array("q")
        self._stops: dict[Step, array[int]] = {
            step: array("q") for step in get_args(Step) if step != "round"
        }
        # The moments between two kept states that were visited last.
        self._near: list[Moment] = []

    def note(self, kind: str, before: RunState, after: RunState) -> None:
        """Notes an event of this kind between two states. One that was noted already is ignored."""
        id = after.revision
        if id <= self._ids[-1]:
            return
        self.end = after
        self._ids.append(id)
        if (len(self._ids) - 1) % GAP == 0:
            self._kept.append(after)
        if len(after.tests) > len(before.tests):
            self._starts.append(id)
        if kind not in _UNSEEN:
            self._stops["moment"].append(id)
        if kind in _VERDICTS or len(after.decisions) > len(before.decisions):
            self._stops["decision"].append(id)
        if len(after.environment) < len(before.environment) and len(after.nodes) > len(
            before.nodes
        ):
            self._stops["reduction"].append(id)
        self._add_to_chapter(kind, before, after)

    def catch_up(self) -> None:
        """Reads and notes all new events. Raises UserError for an invalid one."""
        from ddenv.runfile.fold import steps

        for event, before, after in steps(self._read(self.end.revision, -1), self.end):
            self.note(event.kind, before, after)

    def _add_to_chapter(self, kind: str, before: RunState, after: RunState) -> None:
        last = self.chapters[-1] if self.chapters else None
        if kind == "round_started" and after.round is not None:
            self._begin_chapter("round", after.round.number, after)
        elif kind == "certificate_started":
            self._begin_chapter("certificate", after.certificates[-1].number, after)
        elif last is None:
            self._begin_chapter("baseline", 0, after)
        elif kind not in _UNSEEN and _goes_on(last, after):
            self.chapters[-1] = replace(last, last=after.revision, left=len(after.environment))

    def _begin_chapter(self, kind: ChapterKind, number: int, state: RunState) -> None:
        models = len(state.environment)
        chapter = Chapter(
            kind=kind,
            number=number,
            first=state.revision,
            last=state.revision,
            models=models,
            left=models,
            tests=state.tests_done,
        )
        self.chapters.append(chapter)

    @property
    def now(self) -> RunState:
        """The state at the position."""
        if self.at is None:
            return self.end
        return self.state(self.at)

    def stops(self, what: Step) -> Sequence[int]:
        """The events that a step of this kind goes to, but for the end."""
        if what == "round":
            return [each.last for each in self.chapters]
        return self._stops[what]

    @property
    def ids(self) -> Sequence[int]:
        """The ids of all events, in order."""
        return self._ids[1:]

    @property
    def place(self) -> tuple[int, int]:
        """The number of the position's moment, and of how many."""
        moments = self._stops["moment"]
        return (len(moments) if self.at is None else bisect_right(moments, self.at)), len(moments)

    def state(self, id: int) -> RunState:
        """The state after the last event up to `id`."""
        found = self.moment(id)
        if found is None:
            return self._kept[0]
        return found.after

    def moment(self, id: int) -> Moment | None:
        """The last event up to `id`; None if there is none."""
        from ddenv.runfile.fold import steps

        place = bisect_right(self._ids, id) - 1
        if place <= 0:
            return None
        wanted = self._ids[place]
        if not (self._near and self._near[0].recorded.id <= wanted <= self._near[-1].recorded.id):
            kept = self._kept[(place - 1) // GAP]
            end = self._ids[-1]
            noted = takewhile(lambda event: event.id <= end, self._read(kept.revision, GAP))
            self._near = [Moment(*step) for step in steps(noted, kept)]
        return self._near[bisect_right(self._near, wanted, key=lambda each: each.recorded.id) - 1]

    def start_of(self, test: int) -> Moment | None:
        """The moment in which a test started; None if there is no such test."""
        if 0 < test <= len(self._starts):
            return self.moment(self._starts[test - 1])
        return None

    def go(self, id: int | None) -> None:
        """Goes to the last event up to `id`, or to the end."""
        place = 0 if id is None else bisect_right(self._ids, id) - 1
        self.at = None if id is None or id >= self._ids[-1] else self._ids[max(1, place)]

    def step(self, what: Step, by: int) -> bool:
        """Goes to the next of these (`by` 1) or to the one before (-1); False if there is none.
        After the last comes the end.
        """
        stops = self.stops(what)
        here = self._ids[-1] if self.at is None else self.at
        if by > 0:
            place = bisect_right(stops, here)
            is_end = self.at is None
            self.go(stops[place] if place < len(stops) else None)
            return not is_end
        place = bisect_left(stops, here) - 1
        if self.at is None and what == "round":
            # From the end, which is in the last chapter, one goes to the chapter before it.
            place = min(place, len(stops) - 2)
        if place >= 0:
            self.at = stops[place]
        return place >= 0


def position_in(events: Sequence[Recorded]) -> Position:
    """A position at the end of all these events. Raises UserError for an invalid one."""

    def read(after: int, most: int) -> list[Recorded]:
        begin = bisect_right(events, after, key=lambda event: event.id)
        return list(events[begin : None if most < 0 else begin + most])

    position = Position(read)
    position.catch_up()
    return position


def _goes_on(chapter: Chapter, state: RunState) -> bool:
    """Whether the run is still in its last chapter: what a chapter showed is gone once the run goes
    elsewhere.
    """
    if chapter.kind == "round":
        return (
            state.round is not None
            and not state.round.done
            and state.round.number == chapter.number
        )
    return chapter.kind == "baseline" or state.certificate is not None
