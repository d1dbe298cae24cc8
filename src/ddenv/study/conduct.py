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
    Sitting,
    Work,
    is_done,
    machine,
    opened,
    sittings,
    tests_made,
    versions,
    work,
    write_sittings,
)
from ddenv.text import count, duration, printable
from ddenv.world.scenario import Scenario

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
    return {scenario.name: _size(scenario) for scenario in plan.scenarios}


def _size(scenario: Scenario) -> Size:
    world, _ = load_parts(scenario)
    elements = set(world.elements(frozenset(scenario.protected)))
    moving = sum(not model.static for model in world.models if model.name in elements)
    return Size(len(elements), len(elements) + MOVES * moving)


def seconds_left(
    running: Sequence[Work], waiting: Sequence[Cell], ended: Sequence[Work], worlds: dict[str, Size], jobs: int
) -> float | None:
    """Time until the last cell ends, s; None if unknown."""
    alone = [_of_running(each) for each in running]
    times = [*alone, *(_of_waiting(cell, (*running, *ended), worlds) for cell in waiting)]
    known = [each for each in times if each is not None]
    if len(known) < len(times):
        return None
    return max(sum(known) / jobs, *(seconds / each.workers for seconds, each in zip(known, running, strict=False)), 0)


def _of_running(each: Work) -> float | None:
    """What one worker still needs, s; None if unknown."""
    left = remaining(each.state, True)
    return None if left is None or left.seconds is None else left.seconds[1] * max(1, each.state.jobs)


def _of_waiting(cell: Cell, others: Sequence[Work], worlds: dict[str, Size]) -> float | None:
    """What one worker would need, s: the time of other cells of the scenario, or an estimate by the time of a test."""
    same = [each for each in others if each.cell.scenario.name == cell.scenario.name]
    # Tests reused from another cell cost nothing.
    if over := [
        sum(test.wall_seconds for test in each.state.finished_tests if not test.taken)
        for each in same
        if each.state.status == "finished"
    ]:
        return mean(over)
    tested = [each for each in same if each.state.finished_tests] or [
        each for each in others if each.state.finished_tests
    ]
    if not tested:
        return None
    size = worlds[cell.scenario.name]
    a_test = mean(
        mean(test.wall_seconds for test in each.state.finished_tests)
        * (size.cost / worlds[each.cell.scenario.name].cost)
        for each in tested
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
        self._in_all, self._before = len(plan.cells), done
        self._folder, self._seeds = folder, plan.seeds
        self._worlds, self._jobs = worlds, jobs
        self._out, self._live = out, out.isatty() and os.environ.get("TERM") != "dumb"
        self._earlier, self._begun = sittings(folder), Sitting(time.time(), 0.0, jobs, 0, versions(), machine())
        self._began = self._next_look = time.monotonic()
        self._next_line = self._began + QUIET
        self._cells: tuple[Work, ...] = ()
        self._reported = 0
        self._left: float | None = None

    def look(self, running: Sequence[Work], waiting: Sequence[Cell], ended: Sequence[Work]) -> None:
        """Reports what is new."""
        self._cells = (*running, *ended)
        for each in ended[self._reported :]:
            self._reported += 1
            seed = f", seed {each.cell.seed}" if self._seeds > 1 else ""
            self._say(f"{self._done}  {each.cell.label}{seed}: {self._ending(each)}")
        now = time.monotonic()
        if now >= self._next_look:
            self._left = seconds_left(running, waiting, ended, self._worlds, self._jobs) if running else None
            self._write()
            self._next_look = now + LOOK_PERIOD
        if self._live:
            line = self._now(running, shutil.get_terminal_size().columns - 1)
            print(f"{CLEAR}{printable(line)}", end="", file=self._out, flush=True)
        elif now >= self._next_line and running:
            self._next_line = now + QUIET
            self._say(self._now(running))

    @property
    def _done(self) -> str:
        return f"{self._before + self._reported}/{self._in_all}"

    def close(self) -> None:
        """Records the whole session, and clears the last line."""
        self._write()
        if self._live:
            # The terminal may be gone.
            with contextlib.suppress(OSError):
                print(CLEAR, end="", file=self._out, flush=True)

    def _write(self) -> None:
        tests = sum(tests_made(each.state) - each.made_before for each in self._cells)
        session = replace(self._begun, seconds=time.monotonic() - self._began, tests=tests)
        write_sittings(self._folder, (*self._earlier, session))

    def _say(self, line: str) -> None:
        print(f"{CLEAR if self._live else ''}{printable(line)}", file=self._out, flush=True)

    def _now(self, running: Sequence[Work], columns: int = 200) -> str:
        """The current state, as detailed as fits."""
        left = "" if self._left is None or self._left < LEAST else f" · about {duration(self._left)} left"
        for names in ([each.cell.label for each in running], [each.cell.scenario.name for each in running]):
            doing = (f"{name}: {_doing(each)}" for name, each in zip(names, running, strict=True))
            line = " · ".join((f"{self._done}{left}", *doing))
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
        tests = f"{count(found.tests, 'test')} and {found.certificate_tests} for the certificate"
        doubt = "" if found.minimal else f"; not certified: {found.problem}"
        return f"{sizes}, {tests}, {duration(each.state.working_seconds)}{doubt}"


def _doing(each: Work) -> str:
    state = each.state
    if state.baseline is None:
        return f"{state.tests_done} of {each.cell.scenario.reduction.baseline_runs} baseline runs"
    models = f"{len(state.environment)} of {len(state.elements)} models"
    return f"{models}, {'certificate, ' if state.confirming else ''}{state.tests_done} tests"


def conduct(plan: Plan, folder: Path, jobs: int, out: TextIO) -> int:
    """Makes the missing cells of a study in `folder` with `jobs` workers, and writes its results; returns the exit code.

    0 means that every cell is certified to be minimal, 1 that not all are, 130 that it was interrupted. Raises UserError.
    """
    worlds, interrupted = sizes(plan), False
    with opened(folder):
        names = {cell.name for cell in plan.cells if is_done(folder, cell)}
        open_ones = [cell for cell in plan.cells if cell.name not in names]
        try:
            if open_ones:
                progress = Progress(plan, folder, len(names), worlds, jobs, out)
                if jobs > PER_CELL:
                    # The cells that take longest come first.
                    open_ones.sort(
                        key=lambda cell: (-worlds[cell.scenario.name].cost, not cell.method.pair.startswith(SLOW))
                    )
                with contextlib.closing(progress):
                    work(folder, open_ones, jobs, progress.look)
        except KeyboardInterrupt:
            interrupted = True
        page, found = write_study(plan, folder, sittings(folder))
    for each in found:
        if each.problem and each.cell.name in names:
            print(printable(f"{each.cell.label}, seed {each.cell.seed}: {each.problem}"), file=out)
    minimal = sum(each.minimal for each in found)
    print(printable(f"{minimal} of {count(len(found), 'cell')} certified; wrote {page}"), file=out, flush=True)
    if interrupted:
        print("interrupted; the same command continues", file=sys.stderr)
        return 130
    return 0 if minimal == len(found) else 1
