"""Follows a run without a screen: one line that is drawn over on a terminal, plain lines otherwise."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import time
from pathlib import Path
from typing import TextIO

from ddenv.errors import UserError, printable
from ddenv.runfile.fold import apply, fold
from ddenv.runfile.state import RunState
from ddenv.runfile.store import RunFile
from ddenv.runs.programs import last_words, stop_engines
from ddenv.words import headline, news

POLL = 0.2


class Interrupted(Exception):
    """The user interrupted, and the engine was stopped; `state` is what it left."""

    def __init__(self, state: RunState) -> None:
        super().__init__()
        self.state = state


def follow(path: Path, engine: subprocess.Popen, out: TextIO) -> RunState:
    """Prints what happens until the engine ends; returns the last state. Raises UserError and Interrupted."""
    signal.signal(signal.SIGTERM, _interrupt)
    view = _Line(out) if out.isatty() else _Plain(out)
    with RunFile(path) as file:
        state = fold(file.events())
        before = state.revision
        view.now(state)
        try:
            while engine.poll() is None:
                state = _update(file, state, view)
                time.sleep(POLL)
        except KeyboardInterrupt:
            with contextlib.suppress(KeyboardInterrupt):
                stop_engines([(file, engine)])
            state = _update(file, state, view)
            view.close()
            raise Interrupted(state) from None
        state = _update(file, state, view)
    view.close()
    # An engine that said nothing at all did not start, unless there was nothing left to do.
    silent = state.revision == before and engine.returncode != 0
    if silent or not state.ended:
        raise UserError(last_words(path))
    if state.status == "failed":
        raise UserError(state.reason)
    return state


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt


def _update(file: RunFile, state: RunState, view: _Line | _Plain) -> RunState:
    for event in file.events(state.revision):
        before, state = state, apply(state, event)
        view.happened(event.kind, before, state)
    view.now(state)
    return state


class _Plain:
    """For logs and pipes: one line for each thing worth telling."""

    def __init__(self, out: TextIO) -> None:
        self._out = out

    def happened(self, kind: str, before: RunState, after: RunState) -> None:
        line = news(kind, before, after)
        if line:
            print(printable(line), file=self._out, flush=True)

    def now(self, state: RunState) -> None:
        pass

    def close(self) -> None:
        pass


class _Line(_Plain):
    """For terminals: the same lines, and below them one that is always the latest state."""

    def happened(self, kind: str, before: RunState, after: RunState) -> None:
        line = news(kind, before, after)
        if line:
            print(f"\r\x1b[K{printable(line)}", file=self._out, flush=True)

    def now(self, state: RunState) -> None:
        print(f"\r\x1b[K{printable(headline(state))}", end="", file=self._out, flush=True)

    def close(self) -> None:
        print("\r\x1b[K", end="", file=self._out, flush=True)
