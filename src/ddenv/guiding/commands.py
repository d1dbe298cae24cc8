"""All commands, their form in the run file's table `command`, and the rules that all of them share.

A command is its kind with its fields as JSON: `veto {"round": 2, "candidate": 3}`. Models are numbers into the run's elements.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any, get_args

from ddenv.errors import UserError
from ddenv.evidence.claims import fresh_runs_made, in_the_making
from ddenv.guiding.course import (
    CHANGEABLE,
    ONLY_CHANGEABLE,
    AcceptMode,
    Change,
    GoBack,
    Isolate,
    Pause,
    Resume,
    StartEngine,
    Step,
    Stop,
    Undo,
)
from ddenv.guiding.selections import Accept, AcceptOther, Adopt, Pin, Reject, Try, Unpin, Unveto, Veto
from ddenv.guiding.situation import NO_MODELS, Situation
from ddenv.runfile.state import RunState
from ddenv.text import count

Command = (
    Pause
    | Resume
    | Step
    | AcceptMode
    | Stop
    | Accept
    | Reject
    | Veto
    | Unveto
    | Pin
    | Unpin
    | Try
    | Adopt
    | AcceptOther
    | Undo
    | GoBack
    | Change
)
KINDS: dict[str, Callable[..., Command]] = {each.kind: each for each in get_args(Command)}
FIELDS: dict[str, list[str]] = {each.kind: [field.name for field in fields(each)] for each in get_args(Command)}
# The run goes on from these: an engine starts for them if none is running.
GOES_ON = (Try, Adopt, AcceptOther, Undo, GoBack, Change)
# After these a new search begins, and a certificate that is being made is broken off.
ANEW = (Pin, Unpin, Adopt, AcceptOther, Undo, GoBack)


def refusal(command: Command | StartEngine | Isolate, now: Situation) -> str:
    """Why a command is not possible now, in one line, or ""."""
    return now.barred or command.refusal(now)


def starts_engine(command: Command, state: RunState) -> bool:
    """Whether an engine starts for a command if none is running. Other pins restart a finished search."""
    return isinstance(command, GOES_ON) or (isinstance(command, Pin | Unpin) and state.status == "finished")


def question(command: Command, state: RunState) -> str:
    """What is asked before a command is sent, or "": also where it breaks off a certificate."""
    own, now = command.words(state).question, in_the_making(state)
    begins_anew = command.begins_anew(state) if isinstance(command, Change) else isinstance(command, ANEW)
    if now is None or not begins_anew:
        return own
    made = count(fresh_runs_made(state, now), "run")
    lost = (
        f"This breaks off certificate {now.number} after {made}, which then count for nothing. "
        "A new search begins, and another certificate ends it."
    )
    return f"{own}\n\n{lost}" if own else f"{lost}\n\n{command.words(state).brief.capitalize()} all the same?"


def said(command: Command, now: Situation) -> str:
    """What the screen says when a command is sent, or ""."""
    words = command.words(now.state).said
    if not words or now.engine != "absent":
        return words
    starts = starts_engine(command, now.state)
    return f"{words}; an engine starts for it" if starts else f"{words}; it waits for an engine, space starts one"


def data_of(command: Command) -> dict[str, Any]:
    """The fields of a command as JSON."""
    values = ((name, getattr(command, name)) for name in FIELDS[command.kind])
    return {name: list(value) if isinstance(value, tuple) else value for name, value in values}


def parse(kind: str, data: Mapping[str, Any]) -> Command:
    """A command from a run file. Raises UserError for an unknown kind or invalid data."""
    if kind not in KINDS:
        raise UserError(f"there is no command '{kind[:40]}'")
    return KINDS[kind](**{name: _READ[name](name, data.get(name)) for name in FIELDS[kind]})


def _number(name: str, value: Any) -> int:
    if type(value) is not int:
        raise UserError(f"there is no such {name}: expected its number, found {str(value)[:20]!r}")
    return value


def _models(_: str, value: Any) -> tuple[int, ...]:
    if not isinstance(value, list) or not all(type(number) is int for number in value):
        raise UserError(f"{NO_MODELS}: expected their numbers")
    return tuple(value)


def _unit(_: str, value: Any) -> str:
    return "round" if value == "round" else "test"


def _mode(_: str, value: Any) -> str:
    if value not in ("automatic", "ask"):
        raise UserError("the accept mode is automatic or ask")
    return str(value)


def _yes(_: str, value: Any) -> bool:
    return value is True


def _settings(_: str, value: Any) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise UserError(ONLY_CHANGEABLE)
    # Another program may have written a number as text.
    numbers = {name for name, one in CHANGEABLE.items() if one.kind is int}
    return {str(key): int(each) if key in numbers and str(each).isdecimal() else each for key, each in value.items()}


_READ: dict[str, Callable[[str, Any], Any]] = {
    **dict.fromkeys(("round", "candidate", "trial", "test", "node"), _number),
    "models": _models,
    "unit": _unit,
    "mode": _mode,
    "instead": _yes,
    "settings": _settings,
}
