"""Follows a run without a screen: plain lines, or on a terminal one line that is updated."""

from __future__ import annotations

import contextlib
import json
import shutil
import signal
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

from ddenv.cli.summary import summary, summary_lines
from ddenv.cli.terminal import CLEAR, announce, say, wrapped
from ddenv.errors import UserError
from ddenv.runfile.fold import fold, steps
from ddenv.runfile.state import RunState
from ddenv.runfile.store import ENGINE_WAIT, RunFile
from ddenv.runs.folder import attach_name
from ddenv.runs.programs import last_words, stop_engines
from ddenv.text import printable
from ddenv.words.news import headline, news

POLL = 0.2


@dataclass(eq=False)
class Interrupted(Exception):
    """The user interrupted, and the engine was stopped; `state` is what it left."""

    state: RunState


def follow_to_summary(
    path: Path, engine: subprocess.Popen[bytes], as_json: bool
) -> tuple[int, RunState]:
    """Prints what happens and the result, as one JSON object if asked; returns the exit code and
    the last state.
    """
    try:
        state = follow(path, engine, as_json)
        code = 0 if state.certified else 1
    except Interrupted as interrupted:
        # It may have ended just then.
        state = interrupted.state
        code = 0 if interrupted.state.certified else 130
    if as_json:
        print(json.dumps(summary(state, path)), flush=True)
    else:
        for line in summary_lines(state, path):
            say(line)
    if code == 130:
        print(
            printable(f"interrupted; continue with: ddenv resume {attach_name(path)}"),
            file=sys.stderr,
        )
    return code, state


def follow(path: Path, engine: subprocess.Popen[bytes], as_json: bool) -> RunState:
    """Prints what happens until the engine ends, on stderr if stdout is for JSON; returns the last
    state.

    Raises UserError and Interrupted.
    """
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    out = sys.stderr if as_json else sys.stdout
    interrupted = False
    # On a busy disk the engine may hold its lock for seconds.
    with RunFile(path, wait=ENGINE_WAIT) as file:
        state = fold(file.events())
        before = state.revision
        try:
            while engine.poll() is None:
                state = _show(file, state, out)
                time.sleep(POLL)
        except KeyboardInterrupt:
            interrupted = True
            with contextlib.suppress(KeyboardInterrupt):
                stop_engines([(file, engine)])
        except BrokenPipeError:
            announce(
                f"the engine keeps working on {path}: 'ddenv open {attach_name(path)}' attaches "
                f"to it, 'kill {engine.pid}' stops it"
            )
            raise
        state = _show(file, state, out)
    print(CLEAR if out.isatty() else "", end="", file=out, flush=True)
    if interrupted:
        raise Interrupted(state)
    # An engine without any output did not start, unless there was nothing left to do.
    silent = state.revision == before and engine.returncode != 0
    if silent or not state.ended:
        raise UserError(last_words(path))
    if state.status == "failed":
        raise UserError(state.reason)
    return state


def _show(file: RunFile, state: RunState, out: TextIO) -> RunState:
    """A line for each event after `state` that matters; on a terminal, also the latest state, which
    is returned, below them.
    """
    clear = CLEAR if out.isatty() else ""
    for event, before, after in steps(file.read(state.revision), state):
        state = after
        if line := news(event.kind, before, after):
            lines = wrapped(printable(line), shutil.get_terminal_size().columns if clear else None)
            print(clear + "\n".join(lines), file=out, flush=True)
    if clear:
        simulated = max((live.time for live in file.live()), default=None)
        print(f"{clear}{printable(headline(state, simulated))}", end="", file=out, flush=True)
    return state
