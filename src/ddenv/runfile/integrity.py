"""What is wrong with a run file, and a copy of all that is whole."""

from __future__ import annotations

import json
import sqlite3
import tempfile
from collections.abc import Callable
from contextlib import closing, suppress
from dataclasses import dataclass
from pathlib import Path

from ddenv.errors import UserError
from ddenv.runfile.events import Created, Implied, TestFinished
from ddenv.runfile.fold import apply
from ddenv.runfile.state import BROKEN, RunState
from ddenv.runfile.store import Recorded, Request, RunFile, create

# How many faults SQLite lists.
MOST_FAULTS = 3


@dataclass(frozen=True)
class Whole:
    """The events of a run file that make sense, from the first one on; `trouble` says what is wrong
    with the next, "" if none is. `events` counts them, `state` is what they come to. So many of the
    tests are `bare`: they have no trajectory, as in a recorded run that was made small.
    """

    events: int
    state: RunState
    trouble: str
    bare: int


def faults(file: RunFile) -> list[str]:
    """What SQLite finds wrong with the file; nothing if it is sound."""
    try:
        with closing(sqlite3.connect(file.address, uri=True)) as db:
            rows = db.execute(f"PRAGMA integrity_check({MOST_FAULTS})").fetchall()
    except sqlite3.Error as error:
        return [str(error)]
    if rows == [("ok",)]:
        return []
    return [" ".join(str(words).split()) for (words,) in rows]


def whole(file: RunFile, keep: Callable[[Recorded], None] = lambda _: None) -> Whole:
    """How much of the run can be used. Calls `keep` with each event that makes sense, up to the
    first one that does not.
    """
    state = RunState()
    count = 0
    bare = 0
    trouble = ""
    try:
        for event in file.read():
            state = apply(state, event)
            ended = event.event
            if isinstance(ended, TestFinished) and ended.outcome not in BROKEN:
                # A trajectory that is there has to be whole.
                bare += not file.motion(ended.test) or not file.trajectory(ended.test)
            keep(event)
            count += 1
    except UserError as error:
        trouble = str(error).removeprefix(f"{file.path}: ")
    return Whole(count, state, trouble, bare)


def rescue(file: RunFile, copy: Path) -> Whole:
    """Writes the events that make sense, with their trajectories, to a new run file; returns what
    is in it.

    Raises UserError if `copy` exists or cannot be written, or if even the world of the run cannot
    be read.
    """
    if copy.exists():
        raise UserError(f"{copy}: exists already; choose another name for the copy")
    try:
        first = next(file.read(most=1), None)
        documents = file.documents("")
    except UserError:
        first = None
    if first is None or not isinstance(first.event, Created):
        raise UserError(
            f"{file.path}: nothing can be repaired: its first event, or its world and settings, "
            "are lost"
        )
    try:
        with tempfile.TemporaryDirectory(prefix=f".{copy.name}.", dir=copy.parent) as folder:
            made = Path(folder) / copy.name
            create(made, documents, first.event)
            found = _fill(file, made)
            copy.hardlink_to(made)
    except (OSError, sqlite3.Error) as error:
        raise UserError(
            f"{copy}: cannot be written: {getattr(error, 'strerror', None) or error}"
        ) from None
    return found


def _fill(file: RunFile, made: Path) -> Whole:
    with closing(sqlite3.connect(made, isolation_level=None)) as db:

        def keep(event: Recorded) -> None:
            db.execute("INSERT INTO event VALUES (?, ?, ?, ?)", _row(event))
            if isinstance(event.event, TestFinished | Implied):
                rows = [(event.event.test, *row) for row in file.samples(event.event.test).items()]
                db.executemany("INSERT INTO motion VALUES (?, ?, ?)", rows)

        db.execute("BEGIN")
        db.execute("DELETE FROM event")
        found = whole(file, keep)
        with suppress(UserError):
            db.executemany("INSERT INTO command VALUES (?, ?, ?, ?)", map(_row, file.commands()))
        db.execute("COMMIT")
    return found


def _row(entry: Recorded | Request) -> tuple[int, float, str, str]:
    return (
        entry.id,
        entry.time,
        entry.kind,
        json.dumps(entry.data, allow_nan=False, separators=(",", ":")),
    )
