"""Checks of one run file, and its repair into a copy. The file itself is never written, nor is
anything made beside it.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ddenv import __version__
from ddenv.doctor import Finding
from ddenv.errors import UserError
from ddenv.runfile.integrity import Whole, faults, rescue, whole
from ddenv.runfile.lock import engine_is_alive, mode_beside
from ddenv.runfile.store import RunFile
from ddenv.runs.experiment import read_parts
from ddenv.runs.programs import last_words
from ddenv.text import count


def _finding(what: str, says: str, state: str = "ok", advice: str = "") -> Finding:
    return Finding(group="run", what=what, says=says, state=state, advice=advice)


def run_health(path: Path) -> list[Finding]:
    """What is well and what is not with a run. Raises UserError if there is no such file."""
    alive = engine_is_alive(path)
    found = [_file(path), _log(path, alive)]
    try:
        with _opened(path) as file:
            return [*found, *_content(file, path, alive)]
    except UserError as error:
        if not path.is_file():
            raise
        return [*found, _finding("content", _without(str(error)), "wrong", _repair(path))]


def repair(path: Path, copy: Path) -> list[Finding]:
    """Writes all that is whole of a run to `copy`. Raises UserError if that is nothing, or if
    `copy` cannot be written.
    """
    with _most(path) as file:
        if trouble := _parts(file):
            raise UserError(f"{path}: nothing can be repaired: {trouble}")
        found = rescue(file, copy)
    words = _how_much(found)
    if not found.trouble:
        return [Finding(group="copy", what="copy", says=f"{copy}: complete, {words}")]
    again = f"ddenv resume {copy} repeats the rest"
    return [
        Finding(
            group="copy",
            what="copy",
            says=f"{copy}: {words}; everything after them is lost: {found.trouble}",
            state="note",
            advice=again,
        )
    ]


@contextmanager
def _opened(path: Path, with_log: bool = True) -> Iterator[RunFile]:
    """The run to be read: a copy of it, if a log of an engine that is gone belongs to it."""
    log = _log_of(path) if with_log else None
    alive = engine_is_alive(path)
    if alive or log is None:
        with RunFile(path, untouched=not alive) as file:
            yield file
    else:
        with tempfile.TemporaryDirectory(prefix="ddenv-doctor-") as folder:
            for each in (path, log):
                shutil.copyfile(each, Path(folder) / each.name)
            with RunFile(Path(folder) / path.name) as file:
                yield file


@contextmanager
def _most(path: Path) -> Iterator[RunFile]:
    """The run with its log or without it: the log of another file damages it."""
    if _log_of(path) is None or engine_is_alive(path):
        with _opened(path) as file:
            yield file
        return
    counts = {}
    for with_log in (True, False):
        try:
            with _opened(path, with_log) as file:
                counts[with_log] = whole(file).events
        except UserError:
            if not path.is_file():
                raise
    if not any(counts.values()):
        raise UserError(
            f"{path}: nothing can be repaired: no event can be read, with or without its log"
        )
    with _opened(path, max(counts, key=lambda each: counts[each])) as file:
        yield file


def _file(path: Path) -> Finding:
    if not path.is_file():
        raise UserError(f"{path}: no such run file; 'ddenv runs' lists the runs")
    says = f"{path}, {path.stat().st_size / 1e6:.1f} MB"
    if mode_beside(path) & 0o022:
        return _finding("file", f"{says}; others can write it", "note", f"chmod go-w {path}")
    return _finding(
        "file", f"{says}; {'others' if mode_beside(path) & 0o044 else 'only you'} can read it"
    )


def _log(path: Path, alive: bool) -> Finding:
    log = _log_of(path)
    if log is None:
        return _finding("log", "none: the run is one file")
    says = f"{log.name}, {log.stat().st_size / 1e6:.1f} MB"
    if alive:
        return _finding("log", f"{says}: a copy of the run needs it")
    keep = "keep it beside the run; opening the run merges it"
    return _finding("log", f"{says}: left by a killed engine, and part of the run", "note", keep)


def _log_of(path: Path) -> Path | None:
    """SQLite's log beside a run; None if there is none, or nothing in it."""
    log = path.with_name(f"{path.name}-wal")
    if log.exists() and log.stat().st_size:
        return log
    return None


def _content(file: RunFile, path: Path, alive: bool) -> Iterator[Finding]:
    found = faults(file)
    yield _finding(
        "SQLite", "; ".join(found) or "sound", *(("wrong", _repair(path)) if found else ())
    )
    read = whole(file)
    words = _how_much(read)
    if read.trouble:
        yield _finding(
            "events", f"{words} can be read; then: {read.trouble}", "wrong", _repair(path)
        )
    else:
        yield _finding("events", words)
    trouble = _parts(file)
    says = trouble or "can be read, with the scenario and the robot"
    yield _finding("world", says, "wrong" if trouble else "ok")
    if read.bare:
        says = (
            f"{read.bare} of {count(len(read.state.finished_tests), 'test')} have none, and "
            "cannot be shown"
        )
        yield _finding("trajectories", says, "note")
    now = read.state.physics.now
    other = now and read.state.engine_version not in ("", __version__)
    advice = f"this is ddenv {__version__}: 'ddenv resume' first compares the bits" if other else ""
    yield _finding("made with", now or "nothing yet", "note" if other else "ok", advice)
    yield from (_finding("mixed", each, "note") for each in read.state.physics.mixed if now)
    yield _engine(read, path, alive)


def _parts(file: RunFile) -> str:
    """What is wrong with the scenario, the world or the robot of a run; "" if all can be read."""
    try:
        read_parts(file)
    except UserError as error:
        return _without(str(error))
    return ""


def _how_much(read: Whole) -> str:
    return f"{count(read.events, 'event')}, {count(len(read.state.finished_tests), 'test')}"


def _engine(read: Whole, path: Path, alive: bool) -> Finding:
    state = read.state
    if alive and state.needs_room:
        return _finding("engine", "waiting for disk space", "note")
    if alive:
        return _finding("engine", "running")
    if state.ended:
        return _finding("engine", f"{state.status}: {state.reason}")
    if state.status == "created":
        return _finding("engine", "not started yet")
    says = _without(last_words(path)).partition("; go on with")[0]
    return _finding("engine", f"not running: {says}", "note", f"ddenv resume {path}")


def _repair(path: Path) -> str:
    return f"ddenv doctor {path} --repair COPY"


def _without(words: str) -> str:
    """What is wrong, without the name of the file: it may be that of a copy."""
    head, separator, rest = words.partition(": ")
    if separator and "/" in head:
        return rest
    return words
