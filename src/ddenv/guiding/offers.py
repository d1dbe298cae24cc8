"""What a key does now: the command that it sends, or why it does nothing."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

from ddenv.errors import UserError
from ddenv.evidence.claims import current, helping
from ddenv.guiding.commands import Command, refusal
from ddenv.guiding.course import AcceptMode, Isolate, Pause, Resume, StartEngine, Step, Stop, Undo
from ddenv.guiding.selections import (
    NONE_HELPS,
    Accept,
    AcceptOther,
    Adopt,
    LeaveOut,
    Pin,
    Reject,
    Try,
    Unpin,
    Unveto,
    Veto,
    round_over,
)
from ddenv.guiding.situation import LONGEST, NO_FAILURE, Row, Situation, numbers_of, waiting
from ddenv.runfile.state import REFUSED, RunState, Test, Trial
from ddenv.runfile.tested import adoptable
from ddenv.text import shortened


@dataclass(frozen=True, slots=True)
class Pointed:
    """What the user points at: the `row` under the cursor, which may follow the run (`follows`), and selected `models`."""

    row: Row | None = None
    follows: bool = False
    models: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Offer:
    """What an action does now: `command` is None if a dialog asks for something first, or if it is not possible.

    `words` are for the footer, "" if the action's usual ones fit. `why_not` is why it is not possible now, or "".
    """

    command: Command | StartEngine | Isolate | None = None
    words: str = ""
    why_not: str = ""


Meaning = Callable[[Situation, Pointed], Command | StartEngine | Isolate | None]


def offer(action: str, now: Situation, pointed: Pointed) -> Offer:
    """What an action of `ACTIONS` does now."""
    if now.barred:
        return Offer(why_not=now.barred)
    try:
        command = ACTIONS[action](now, pointed)
    except UserError as error:
        return Offer(why_not=str(error))
    if command is None:
        return Offer()
    why_not = refusal(command, now)
    again = isinstance(command, StartEngine) and now.state.engines
    return Offer(why_not=why_not) if why_not else Offer(command, "resume" if again else _FOOTER.get(type(command), ""))


def _pause(now: Situation, _: Pointed) -> Command | StartEngine:
    if now.engine == "absent":
        return StartEngine()
    return Resume() if now.state.paused else Pause()


def _accept(now: Situation, pointed: Pointed) -> Command:
    """Accept what waits, or else what is under the cursor, or else the last try that shows f."""
    state, row = now.state, pointed.row
    if state.round is not None and (waits := waiting(state)):
        return Accept(state.round.number, waits.index)
    # While the cursor follows the run, its row may change before the key is pressed.
    if row is not None and pointed.follows and not isinstance(row, Trial) and not state.paused:
        row = None
    if isinstance(row, Trial) and row.verdict == "similar":
        return Adopt(row.number)
    other = None if row is None or row.verdict == "similar" else nearest_other(state, row)
    if other is not None:
        return AcceptOther(other.id)
    if last := adoptable(state):
        return Adopt(last.number)
    if row is None:
        raise UserError("there is nothing to accept")
    if row.verdict == "similar":
        raise UserError(f"{row.label} is accepted already")
    why = f"is {row.verdict}" if row.verdict else "is not judged yet"
    raise UserError(f"there is nothing to accept: {row.label} {why}, and shows no other failure")


def nearest_other(state: RunState, row: Row) -> Test | None:
    """The test of a candidate or try that ended in another failure, nearest to the end of f."""
    others = [test for test in state.tests_of(row.tests) if test.outcome == "other" and test.end_pose is not None]
    return min(others, key=lambda test: (test.distance is None, test.distance or 0.0), default=None)


def _reject(now: Situation, _: Pointed) -> Command:
    waits = waiting(now.state)
    if now.state.round is None or waits is None:
        raise UserError("there is nothing to reject")
    return Reject(now.state.round.number, waits.index)


def _veto(now: Situation, pointed: Pointed) -> Command:
    state, row = now.state, pointed.row
    if isinstance(row, Trial):
        raise UserError(f"{row.label} is your own selection; only candidates of the round can be vetoed")
    if state.round is None:
        raise UserError("there are no candidates yet")
    if row is None:
        raise UserError(
            round_over(state) if state.round.done else "no candidate is under the cursor: 2 shows the table"
        )
    make = Unveto if row.verdict in REFUSED else Veto
    return make(state.round.number, row.index)


def _pin(now: Situation, pointed: Pointed) -> Command | None:
    if not _any(now.state, pointed.models):
        return None
    state, models = now.state, pointed.models
    if all(name in state.pinned for name in models):
        return Unpin(numbers_of(state, models))
    return Pin(numbers_of(state, (name for name in models if name not in state.pinned)))


def _try(now: Situation, pointed: Pointed, keep: frozenset[str]) -> Command | None:
    if now.state.baseline is None:
        raise UserError(NO_FAILURE)
    return Try(numbers_of(now.state, keep)) if _any(now.state, pointed.models) else None


def _leave_out(now: Situation, _: Pointed) -> Command:
    found = current(now.state)
    helps = () if found is None else helping(found)
    if not helps:
        raise UserError(NONE_HELPS)
    return LeaveOut(numbers_of(now.state, helps[:1])[0])


def _isolate(now: Situation, _: Pointed) -> Command | Isolate:
    return Stop() if now.engine != "absent" and now.state.isolating is not None else Isolate()


def _any(state: RunState, models: Collection[str]) -> bool:
    """Whether models are selected; if not, a dialog asks for some. Raises UserError for models that cannot be selected."""
    if not models:
        if not state.environment:
            raise UserError("there are no models to choose from")
        return False
    elements = frozenset(state.elements)
    fixed = next((name for name in models if name not in elements), None)
    if fixed is not None:
        raise UserError(f"{shortened(fixed, LONGEST)} is protected: it always stays")
    return True


# What the footer calls a command where the action's usual words do not fit.
_FOOTER: dict[type, str] = {
    StartEngine: "start",
    Pause: "pause",
    Resume: "resume",
    Accept: "accept",
    Adopt: "adopt",
    AcceptOther: "count as f",
    Reject: "reject",
    Veto: "veto",
    Unveto: "take back",
    Undo: "undo",
    Stop: "stop",
}

# By the names of the run screen's actions. Its other actions change nothing in the run.
ACTIONS: dict[str, Meaning] = {
    "pause": _pause,
    "resume": lambda now, pointed: StartEngine(),
    "step": lambda now, pointed: Step("test"),
    "step_round": lambda now, pointed: Step("round"),
    "mode": lambda now, pointed: AcceptMode("automatic" if now.state.accept_mode == "ask" else "ask"),
    "accept": _accept,
    "reject": _reject,
    "veto": _veto,
    "pin": _pin,
    "without": lambda now, pointed: _try(now, pointed, frozenset(now.state.environment).difference(pointed.models)),
    "only": lambda now, pointed: _try(now, pointed, frozenset(pointed.models)),
    "leave_out": _leave_out,
    "undo": lambda now, pointed: Undo(),
    "isolate": _isolate,
    # A dialog asks for the settings.
    "change": lambda now, pointed: None,
}
