"""What is told while a study is made: a line for each cell that has ended, and on a terminal a last line on what happens now."""

from __future__ import annotations

import contextlib
import os
import shutil
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TextIO

from rich.cells import cell_len, set_cell_size

from ddenv.errors import printable
from ddenv.study.found import read_cell
from ddenv.study.left import seconds_left
from ddenv.study.order import Size
from ddenv.study.plan import Cell, Plan
from ddenv.study.work import Work
from ddenv.words import count, duration

# What is left takes a while to find, s.
PERIOD = 2.0
# To the beginning of the line, and nothing on it any more.
CLEAR = "\r\x1b[K"
# Logs and pipes get a line on what happens now so often, s.
QUIET = 60.0
# Less than this is not told of what is left, s.
LEAST = 5.0


class Progress:
    """Tells of the study `plan` in `folder`, of which so many cells were `done` before; `jobs` workers make it."""

    def __init__(self, plan: Plan, folder: Path, done: int, worlds: dict[str, Size], jobs: int, out: TextIO) -> None:
        self._in_all, self._before = len(plan.cells), done
        self._folder, self._seeds = folder, plan.seeds
        self._worlds, self._jobs = worlds, jobs
        self._out, self._live = out, out.isatty() and os.environ.get("TERM") != "dumb"
        self._told = 0
        self._next_look = 0.0
        self._next_line = time.monotonic() + QUIET
        self._left: float | None = None

    def look(self, running: Sequence[Work], waiting: Sequence[Cell], ended: Sequence[Work]) -> None:
        """Tells what is new."""
        for each in ended[self._told :]:
            self._told += 1
            seed = f", seed {each.cell.seed}" if self._seeds > 1 else ""
            self._say(f"{self._done}  {each.cell.label}{seed}: {self._ending(each)}")
        now = time.monotonic()
        if now >= self._next_look:
            self._left = seconds_left(running, waiting, ended, self._worlds, self._jobs) if running else None
            self._next_look = now + PERIOD
        if self._live:
            line = self._now(running, shutil.get_terminal_size().columns - 1)
            print(f"{CLEAR}{printable(line)}", end="", file=self._out, flush=True)
        elif now >= self._next_line and running:
            self._next_line = now + QUIET
            self._say(self._now(running))

    @property
    def _done(self) -> str:
        return f"{self._before + self._told}/{self._in_all}"

    def close(self) -> None:
        """Takes the last line away."""
        if self._live:
            # The terminal may be what is gone.
            with contextlib.suppress(OSError):
                print(CLEAR, end="", file=self._out, flush=True)

    def _say(self, line: str) -> None:
        print(f"{CLEAR if self._live else ''}{printable(line)}", file=self._out, flush=True)

    def _now(self, running: Sequence[Work], columns: int = 200) -> str:
        """What happens, as fully as there is room."""
        left = "" if self._left is None or self._left < LEAST else f" · about {duration(self._left)} left"
        for said in (_fully, _short):
            line = " · ".join((f"{self._done}{left}", *map(said, running)))
            if cell_len(line) <= columns:
                break
        return set_cell_size(line, columns).rstrip() if running else ""

    def _ending(self, each: Work) -> str:
        """How a cell ended, in one line."""
        if each.problem:
            return each.problem
        found = read_cell(self._folder, each.cell)
        if found.baseline is None:
            return found.problem
        sizes = f"{len(found.elements)} → {count(len(found.left), 'model')}"
        doubt = f"; {'' if found.minimal else 'not minimal: '}{found.trouble}" if found.trouble else ""
        return f"{sizes}, {count(found.tests, 'test')}, {duration(each.state.working_seconds)}{doubt}"


def _fully(each: Work) -> str:
    return f"{each.cell.label}: {_doing(each)}"


def _short(each: Work) -> str:
    return f"{each.cell.scenario.name}: {_doing(each)}"


def _doing(each: Work) -> str:
    state = each.state
    if each.check is not None:
        return "leaving each out once more"
    if state.baseline is None:
        return f"{state.tests_done} of {each.cell.scenario.reduction.baseline_runs} baseline runs"
    return f"{len(state.environment)} of {len(state.elements)} models, {state.tests_done} tests"
