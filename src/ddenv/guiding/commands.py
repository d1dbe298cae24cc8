"""All commands, their form in the run file's table `command`, and the rules that all of them share.

A command is its kind with its fields as JSON: `veto {"round": 2, "candidate": 3}`. Models are numbers into the run's elements.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any, get_args

from ddenv.errors import UserError
from ddenv.evidence.claims import fresh_runs_made, in_the_making
from ddenv.guiding.course import Change, CourseCommand, GoBack, Isolate, StartEngine, Undo
from ddenv.guiding.selections import AcceptOther, Adopt, LeaveOut, Pin, SelectionCommand, Try, Unpin
from ddenv.guiding.situation import Situation, waiting
from ddenv.runfile.reading import Invalid, plain, read
from ddenv.runfile.state import RunState
from ddenv.runfile.store import RunFile
from ddenv.text import as_sentence, count, snake_case

Command = CourseCommand | SelectionCommand
KINDS: dict[str, type[Command]] = {snake_case(each.__name__): each for each in get_args(Command)}
# The run goes on from these: an engine starts for them if none is running.
GOES_ON = (Try, Adopt, LeaveOut, AcceptOther, Undo, GoBack, Change)
# After these a new search begins: a certificate that is being made is broken off, a reduction that waits is dropped.
ANEW = (Pin, Unpin, Adopt, AcceptOther, Undo, GoBack)


def refusal(command: Command | StartEngine | Isolate, now: Situation) -> str:
    """Why a command is not possible now, in one line, or ""."""
    return now.barred or command.refusal(now)


def starts_engine(command: Command, state: RunState) -> bool:
    """Whether an engine starts for a command if none is running. Other pins restart a finished search."""
    return isinstance(command, GOES_ON) or (isinstance(command, Pin | Unpin) and state.status == "finished")


def drops(command: Command, state: RunState) -> str:
    """That the new search which a command begins would drop the reduction that waits, or ""."""
    waits = waiting(state) if _begins_anew(command, state) else None
    if waits is None:
        return ""
    sizes = f"{len(state.environment)} → {count(waits.size, 'model')}"
    return f"{as_sentence(waits.label)[:-1]} shows f and waits for you ({sizes}); a new search would drop it."


def _begins_anew(command: Command, state: RunState) -> bool:
    return command.begins_anew(state) if isinstance(command, Change) else isinstance(command, ANEW)


def question(command: Command, state: RunState) -> str:
    """What is asked before a command is sent, or "": also where it breaks off a certificate, or drops a reduction that waits."""
    own, now, lost = command.words(state).question, in_the_making(state), drops(command, state)
    if now is not None and _begins_anew(command, state):
        made = count(fresh_runs_made(state, now), "run")
        lost = (
            f"This aborts certificate {now.number} after {made}, which then no longer count. "
            "A new search begins and ends with another certificate."
        )
    if not lost:
        return own
    return f"{own}\n\n{lost}" if own else f"{lost}\n\n{command.words(state).brief.capitalize()} anyway?"


def said(command: Command, now: Situation) -> str:
    """What the screen says when a command is sent, or ""."""
    words = command.words(now.state).said
    if not words or now.engine != "absent":
        return words
    starts = starts_engine(command, now.state)
    return f"{words}; an engine starts for it" if starts else f"{words}; it waits for an engine, space starts one"


def send(file: RunFile, command: Command) -> int:
    """Asks the engine of a run; returns the number of the command. Raises UserError."""
    kind, data = written(command)
    return file.send(kind, **data)


def written(command: Command) -> tuple[str, dict[str, Any]]:
    """A command as it stands in the run file: its kind, and its fields as JSON."""
    return snake_case(type(command).__name__), plain(command)


def parse(kind: str, data: Mapping[str, Any]) -> Command:
    """A command from a run file. Raises UserError for an unknown kind or invalid data."""
    if kind not in KINDS:
        raise UserError(f"there is no command '{kind[:40]}'")
    try:
        command: Command = read(KINDS[kind], json.dumps(data))
    except Invalid as invalid:
        raise UserError(f"no such {invalid}") from None
    return command
