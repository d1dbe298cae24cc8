"""A study from start to end: makes the remaining cells, shows progress, and records when it was worked on."""

from __future__ import annotations

import contextlib
import os
import shutil
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from statistics import mean
from typing import NamedTuple, TextIO

from rich.cells import cell_len, set_cell_size

from ddenv.runs.subject import load_parts
from ddenv.runs.tests_left import remaining, rough_run
from ddenv.study.plan import Cell, Plan
from ddenv.study.results import read_cell
from ddenv.study.study_page import write_study
from ddenv.study.work import (
    PER_CELL,
    Session,
    Work,
    is_done,
    machine,
    make_cells,
    opened,
    sessions,
    versions,
    write_sessions,
)
from ddenv.text import count, duration, printable

# The cost of a dynamic model in a test, relative to a static one: about what piles of boards cost when measured.
MOVES = 4
# Equal spans of time put most of a world into one part, which takes many rounds to split.
SLOW = ("timeseg/", "trajectoryseg/")


class Size(NamedTuple):
    """A scenario's world: how many models can be removed, and the cost of a test, in static models."""

    models: int
    cost: int


def sizes(plan: Plan) -> dict[str, Size]:
    """The sizes of the scenarios' worlds by the scenarios' names. Raises UserError for a world or a robot that cannot be read."""
    known: dict[str, Size] = {}
    for scenario in plan.scenarios:
        world, _ = load_parts(scenario)
        elements = set(world.elements(frozenset(scenario.protected)))
        moving = sum(not model.static for model in world.models if model.name in elements)
        known[scenario.name] = Size(len(elements), len(elements) + MOVES * moving)
    return known


def seconds_left(
    running: Sequence[Work], waiting: Sequence[Cell], ended: Sequence[Work], worlds: dict[str, Size], jobs: int
) -> float | None:
    """Time until the last cell ends, s; None if unknown."""
    tested = [work for work in (*running, *ended) if work.state.finished_tests]
    alone: list[float] = []
    for work in running:
        left = remaining(work.state, True)
        if left is None or left.seconds is None:
            return None
        alone.append(left.seconds[1] * max(1, work.state.jobs))
    if waiting and not tested:
        return None
    rest = sum(_of_waiting(cell, tested, worlds) for cell in waiting)
    return max((sum(alone) + rest) / jobs, *(time / work.workers for time, work in zip(alone, running, strict=True)), 0)


def _of_waiting(cell: Cell, tested: Sequence[Work], worlds: dict[str, Size]) -> float:
    """What one worker would need, s: the time of other cells of the scenario, or an estimate by the time of a test."""
    same = [work for work in tested if work.cell.scenario.name == cell.scenario.name]
    # Tests reused from another cell cost nothing.
    over = [
        sum(test.wall_seconds for test in work.state.finished_tests if not test.taken)
        for work in same
        if work.state.status == "finished"
    ]
    if over:
        return mean(over)
    size = worlds[cell.scenario.name]
    a_test = mean(
        mean(test.wall_seconds for test in work.state.finished_tests) * size.cost / worlds[work.cell.scenario.name].cost
        for work in same or tested
    )
    return a_test * rough_run(size.models, cell.scenario.reduction, slices=cell.scenario.oracle is None).tests[1]


# Time between two estimates of the time left, which are slow, and two records of the time so far, s: a killed study loses the time
# since the last one.
LOOK_PERIOD = 2.0
# To the start of the line, and clears it.
CLEAR = "\r\x1b[K"
# Time between two lines of progress in logs and pipes, s.
QUIET = 60.0
# A shorter time left is not shown, s.
LEAST = 5.0


class Progress:
    """Shows how far the study `plan` in `folder` is, and records there how long this session has worked on it.

    `done` cells were finished before; `jobs` workers run tests. Raises UserError if earlier records cannot be read.
    """

    def __init__(self, plan: Plan, folder: Path, done: int, worlds: dict[str, Size], jobs: int, out: TextIO) -> None:
        self._plan, self._folder, self._done, self._worlds, self._jobs = plan, folder, done, worlds, jobs
        self._out, self._live = out, out.isatty() and os.environ.get("TERM") != "dumb"
        self._earlier, self._session = sessions(folder), Session(time.time(), 0.0, jobs, 0, versions(), machine())
        self._began = self._next_look = time.monotonic()
        self._next_line = self._began + QUIET
        self._known: tuple[Work, ...] = ()
        self._reported = 0
        self._left: float | None = None

    @property
    def _share(self) -> str:
        return f"{self._done + self._reported}/{len(self._plan.cells)}"

    def look(self, running: Sequence[Work], waiting: Sequence[Cell], ended: Sequence[Work]) -> None:
        """Reports what is new."""
        self._known = (*running, *ended)
        for work in ended[self._reported :]:
            self._reported += 1
            seed = f", seed {work.cell.seed}" if self._plan.seeds > 1 else ""
            self._say(f"{self._share}  {work.cell.label}{seed}: {self._ending(work)}")
        now = time.monotonic()
        if now >= self._next_look:
            self._left = seconds_left(running, waiting, ended, self._worlds, self._jobs) if running else None
            self._record()
            self._next_look = now + LOOK_PERIOD
        if self._live:
            line = self._now(running, shutil.get_terminal_size().columns - 1)
            print(f"{CLEAR}{printable(line)}", end="", file=self._out, flush=True)
        elif now >= self._next_line and running:
            self._next_line = now + QUIET
            self._say(self._now(running))

    def close(self) -> None:
        """Records the whole session, and clears the last line."""
        self._record()
        if self._live:
            # The terminal may be gone.
            with contextlib.suppress(OSError):
                print(CLEAR, end="", file=self._out, flush=True)

    def _record(self) -> None:
        seconds, tests = time.monotonic() - self._began, sum(work.tests for work in self._known)
        write_sessions(self._folder, (*self._earlier, replace(self._session, seconds=seconds, tests=tests)))

    def _say(self, line: str) -> None:
        print(f"{CLEAR if self._live else ''}{printable(line)}", file=self._out, flush=True)

    def _now(self, running: Sequence[Work], columns: int = 200) -> str:
        """The current state, as detailed as fits."""
        if not running:
            return ""
        left = "" if self._left is None or self._left < LEAST else f" · about {duration(self._left)} left"
        for names in ([work.cell.label for work in running], [work.cell.scenario.name for work in running]):
            doing = (f"{name}: {_doing(work)}" for name, work in zip(names, running, strict=True))
            line = " · ".join((f"{self._share}{left}", *doing))
            if cell_len(line) <= columns:
                break
        return set_cell_size(line, columns).rstrip()

    def _ending(self, work: Work) -> str:
        """How a cell ended, in one line."""
        if work.problem:
            return work.problem
        result = read_cell(self._folder, work.cell)
        if result.baseline is None:
            return result.problem
        sizes = f"{len(result.elements)} → {count(len(result.left), 'model')}"
        tests = f"{count(result.tests, 'test')} and {result.certificate_tests} for the certificate"
        doubt = "" if result.minimal else f"; not certified: {result.problem}"
        return f"{sizes}, {tests}, {duration(work.state.working_seconds)}{doubt}"


def _doing(work: Work) -> str:
    state = work.state
    if state.baseline is None:
        return f"{state.tests_done} of {work.cell.scenario.reduction.baseline_runs} baseline runs"
    models = f"{len(state.environment)} of {len(state.elements)} models"
    return f"{models}, {'certificate, ' if state.confirming else ''}{state.tests_done} tests"


def conduct(plan: Plan, folder: Path, jobs: int, out: TextIO) -> int:
    """Makes the missing cells of a study in `folder` with `jobs` workers, and writes its results; returns the exit code.

    0 means that every cell is certified to be minimal, 1 that not all are, 130 that it was interrupted. Raises UserError.
    """
    worlds, interrupted = sizes(plan), False
    with opened(folder):
        done = {cell.name for cell in plan.cells if is_done(folder, cell)}
        cells = [cell for cell in plan.cells if cell.name not in done]
        if jobs > PER_CELL:
            # The cells that take longest come first.
            cells.sort(key=lambda cell: (-worlds[cell.scenario.name].cost, not cell.method.pair.startswith(SLOW)))
        try:
            if cells:
                with contextlib.closing(Progress(plan, folder, len(done), worlds, jobs, out)) as progress:
                    make_cells(folder, cells, jobs, progress.look)
        except KeyboardInterrupt:
            interrupted = True
        page, results = write_study(plan, folder, sessions(folder))
    for result in results:
        if result.problem and result.cell.name in done:
            print(printable(f"{result.cell.label}, seed {result.cell.seed}: {result.problem}"), file=out)
    minimal = sum(result.minimal for result in results)
    print(printable(f"{minimal} of {count(len(results), 'cell')} certified; wrote {page}"), file=out, flush=True)
    if interrupted:
        print("interrupted; the same command continues", file=sys.stderr)
        return 130
    return 0 if minimal == len(results) else 1
