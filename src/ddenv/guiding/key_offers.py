"""What a key does now: the command that it sends, or why it does nothing."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass

from ddenv.errors import UserError
from ddenv.evidence.claims import current, only_helping
from ddenv.guiding import commands as c
from ddenv.runfile.state import REFUSED, RunState, Test, Trial
from ddenv.runfile.tested import adoptable
from ddenv.text import Names


@dataclass(frozen=True, slots=True)
class Pointed:
    """What the user points at: the `row` under the cursor, which may follow the run (`follows`),
    and selected `models`.
    """

    row: c.Row | None = None
    follows: bool = False
    models: Names = ()


@dataclass(frozen=True, slots=True)
class KeyOffer:
    """What an action does now: `command` is None if a dialog asks for something first, or if it is
    not possible.

    `words` are for the footer, "" if the action's usual ones fit. `why_not` is why it is not
    possible now, or "".
    """

    command: c.Command | c.StartEngine | c.Isolate | None = None
    words: str = ""
    why_not: str = ""


Meaning = Callable[[c.Context, Pointed], c.Command | c.StartEngine | c.Isolate | None]


def offer(action: str, now: c.Context, pointed: Pointed) -> KeyOffer:
    """What an action of `ACTIONS` does now."""
    if now.barred:
        return KeyOffer(why_not=now.barred)
    try:
        command = ACTIONS[action](now, pointed)
    except UserError as error:
        return KeyOffer(why_not=str(error))
    if command is None:
        return KeyOffer()
    why_not = c.refusal(command, now)
    again = isinstance(command, c.StartEngine) and now.state.engines
    if why_not:
        return KeyOffer(why_not=why_not)
    return KeyOffer(command, "resume" if again else _FOOTER.get(type(command), ""))


def _pause(now: c.Context, _: Pointed) -> c.Command | c.StartEngine:
    if now.engine == "absent":
        return c.StartEngine()
    if now.state.paused:
        return c.Resume()
    return c.Pause()


def _accept(now: c.Context, pointed: Pointed) -> c.Command:
    """Accept what waits, or else what is under the cursor, or else the last try that shows f."""
    state = now.state
    row = pointed.row
    if state.round is not None and (waits := c.waiting(state)):
        return c.Accept(state.round.number, waits.index)
    # While the cursor follows the run, its row may change before the key is pressed.
    if row is not None and pointed.follows and not isinstance(row, Trial) and not state.paused:
        row = None
    if isinstance(row, Trial) and row.verdict == "similar":
        return c.Adopt(row.number)
    other = None if row is None or row.verdict == "similar" else nearest_other(state, row)
    if other is not None:
        return c.AcceptOther(other.id)
    if last := adoptable(state):
        return c.Adopt(last.number)
    if row is None:
        raise UserError("there is nothing to accept")
    if row.verdict == "similar":
        raise UserError(f"{row.label} is accepted already")
    why = f"is {row.verdict}" if row.verdict else "is not judged yet"
    raise UserError(f"there is nothing to accept: {row.label} {why}, and shows no other failure")


def nearest_other(state: RunState, row: c.Row) -> Test | None:
    """The test of a candidate or try that ended in another failure, nearest to the end of f."""
    others = [
        test
        for test in state.tests_of(row.tests)
        if test.outcome == "other" and test.end_pose is not None
    ]
    return min(others, key=lambda test: (test.distance is None, test.distance or 0.0), default=None)


def _reject(now: c.Context, _: Pointed) -> c.Command:
    waits = c.waiting(now.state)
    if now.state.round is None or waits is None:
        raise UserError("there is nothing to reject")
    return c.Reject(now.state.round.number, waits.index)


def _veto(now: c.Context, pointed: Pointed) -> c.Command:
    state = now.state
    row = pointed.row
    if isinstance(row, Trial):
        raise UserError(
            f"{row.label} is your own selection; only candidates of the round can be vetoed"
        )
    if state.round is None:
        raise UserError("there are no candidates yet")
    if row is None:
        raise UserError(
            c.round_over(state)
            if state.round.done
            else "no candidate is under the cursor: 2 shows the table"
        )
    make = c.Unveto if row.verdict in REFUSED else c.Veto
    return make(state.round.number, row.index)


def _pin(now: c.Context, pointed: Pointed) -> c.Command | None:
    if not _any(now.state, pointed.models):
        return None
    state = now.state
    models = pointed.models
    if all(name in state.pinned for name in models):
        return c.Unpin(c.numbers_of(state, models))
    return c.Pin(c.numbers_of(state, (name for name in models if name not in state.pinned)))


def _try(now: c.Context, pointed: Pointed, keep: frozenset[str]) -> c.Command | None:
    if now.state.baseline is None:
        raise UserError(c.NO_FAILURE)
    if _any(now.state, pointed.models):
        return c.Try(c.numbers_of(now.state, keep))
    return None


def _leave_out(now: c.Context, _: Pointed) -> c.Command:
    found = current(now.state)
    helps = () if found is None else only_helping(found)
    if not helps:
        raise UserError(c.NONE_HELPS)
    return c.LeaveOut(c.numbers_of(now.state, helps[:1])[0])


def _isolate(now: c.Context, _: Pointed) -> c.Command | c.Isolate:
    if now.engine != "absent" and now.state.isolating is not None:
        return c.Stop()
    return c.Isolate()


def _any(state: RunState, models: Collection[str]) -> bool:
    """Whether models are selected; if not, a dialog asks for some. Raises UserError for models that
    cannot be selected.
    """
    if not models:
        if not state.environment:
            raise UserError("there are no models to choose from")
        return False
    elements = frozenset(state.elements)
    fixed = next((name for name in models if name not in elements), None)
    if fixed is not None:
        raise UserError(f"{c.named([fixed])} is protected: it always stays")
    return True


# What the footer calls a command where the action's usual words do not fit.
_USUAL = (c.Pause, c.Resume, c.Accept, c.Adopt, c.Reject, c.Veto, c.Undo, c.Stop)
_FOOTER: dict[type, str] = {kind: kind.__name__.lower() for kind in _USUAL}
_FOOTER |= {c.StartEngine: "start", c.AcceptOther: "count as f", c.Unveto: "take back"}

# By the names of the run screen's actions. Its other actions change nothing in the run.
ACTIONS: dict[str, Meaning] = {
    "pause": _pause,
    "resume": lambda now, pointed: c.StartEngine(),
    "step": lambda now, pointed: c.Step("test"),
    "step_round": lambda now, pointed: c.Step("round"),
    "mode": lambda now, pointed: c.AcceptMode(
        "automatic" if now.state.accept_mode == "ask" else "ask"
    ),
    "accept": _accept,
    "reject": _reject,
    "veto": _veto,
    "pin": _pin,
    "without": lambda now, pointed: _try(
        now, pointed, frozenset(now.state.environment).difference(pointed.models)
    ),
    "only": lambda now, pointed: _try(now, pointed, frozenset(pointed.models)),
    "leave_out": _leave_out,
    "undo": lambda now, pointed: c.Undo(),
    "isolate": _isolate,
    # A dialog asks for the settings.
    "change": lambda now, pointed: None,
}
