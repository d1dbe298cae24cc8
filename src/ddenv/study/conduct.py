"""A study from start to end: makes the remaining cells, several at the same time, each with its own
engine, and shows progress.
"""

from __future__ import annotations

import contextlib
import os
import shutil
import signal
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TextIO

from rich.cells import set_cell_size

from ddenv.errors import UserError
from ddenv.evidence.claims import current
from ddenv.runfile.fold import fold
from ddenv.runfile.lock import engine_is_alive
from ddenv.runfile.store import RunFile
from ddenv.runs.creation import create_run
from ddenv.runs.engine_job import EngineOptions
from ddenv.runs.experiment import load_parts
from ddenv.runs.programs import STOP_WAIT, last_words, start_engine, stop_engines
from ddenv.study.folder import Session, machine, opened, sessions, versions, write_sessions
from ddenv.study.plan import Cell, Plan, run_path
from ddenv.study.results import difference, read_cell
from ddenv.study.study_page import write_study
from ddenv.text import count, duration, printable

# With more workers for a cell, most of the additional tests are not needed.
PER_CELL = 2
POLL = 0.2
# Time between two records of the time so far, s: a killed study loses the time since the last one.
RECORD_PERIOD = 2.0
# To the start of the line, and clears it.
CLEAR = "\r\x1b[K"
# Time between two lines of progress in logs and pipes, s.
QUIET = 60.0


class Work:
    """A cell in work by so many `workers`; its run was as `before`. `problem` says why it did not
    end this time.
    """

    def __init__(self, folder: Path, cell: Cell, workers: int) -> None:
        self.cell = cell
        self.workers = workers
        self.problem = ""
        self.path = run_path(folder, cell)
        if not self.path.exists():
            create_run(cell.scenario, self.path)
        self.file = RunFile(self.path)
        self.before = self.state = fold(self.file.events())
        options = EngineOptions(
            jobs=workers, accept_mode="automatic", shared_folder=str(self.path.parent)
        )
        self.engine = start_engine(self.path, options)

    @property
    def tests(self) -> int:
        """How many tests this session has made, and not reused from another cell."""
        now, then = (
            each.made - sum(test.taken for test in each.tests) for each in (self.state, self.before)
        )
        return now - then

    def catch_up(self) -> None:
        self.state = fold(self.file.events(self.state.revision), self.state)

    def has_ended(self) -> bool:
        """Whether no engine works on it any more."""
        # This comes before the events are read, so none is missed. Where the engine of a killed
        # study works, ours gave up.
        at_work = self.engine.poll() is None or engine_is_alive(self.path)
        self.catch_up()
        if not at_work and self.state.status != "finished":
            # If an engine died before it wrote anything, the reason in the file is an earlier
            # engine's.
            said = self.state.ended and self.state.revision > self.before.revision
            self.problem = self.state.reason if said else last_words(self.path)
        return not at_work


def is_done(folder: Path, cell: Cell) -> bool:
    """Whether nothing is left to do for a cell. Raises UserError if its run file has other
    settings.
    """
    path = run_path(folder, cell)
    if not path.exists():
        return False
    try:
        with RunFile(path) as file:
            state = fold(file.events())
            other = difference(file, cell)
    except UserError as error:
        raise UserError(f"{error}; delete that file, or choose another folder with -o") from None
    if other:
        raise UserError(
            f"{path}: was made with {other}; choose another folder with -o, or delete {path.parent}"
        )
    if state.status != "finished" or engine_is_alive(path):
        return False
    # Where the baseline, or a claim of the certificate, is open since tests broke, an engine makes
    # them again.
    if state.baseline is None:
        return not all(test.broke for test in state.finished_tests)
    certificate = current(state)
    return certificate is None or all(claim.verdict != "unknown" for claim in certificate.claims)


class Runner:
    """One session of work on the study `plan` in `folder`: makes `cells` with `jobs` workers in
    all, and says and records how far it is. Raises UserError if earlier sessions cannot be read.
    """

    def __init__(
        self, plan: Plan, folder: Path, cells: Sequence[Cell], jobs: int, out: TextIO
    ) -> None:
        self._plan = plan
        self._folder = folder
        self._jobs = jobs
        self._waiting = list(cells)
        self.running: list[Work] = []
        self._ended: list[Work] = []
        self._out = out
        self._live = out.isatty() and os.environ.get("TERM") != "dumb"
        self._earlier = sessions(folder)
        self._session = Session(
            begun=time.time(),
            seconds=0.0,
            jobs=jobs,
            tests=0,
            versions=versions(),
            machine=machine(),
        )
        self._began = self._next_record = time.monotonic()
        self._next_line = self._began + QUIET

    def run(self) -> None:
        """Makes the cells.

        On KeyboardInterrupt the engines are stopped, and it is raised again. Raises UserError if a
        run file cannot be created, and then stops the engines, too.
        """
        # Ignored signals stay ignored: a study under nohup outlives its terminal.
        asked = [
            number
            for number in (signal.SIGTERM, signal.SIGHUP)
            if signal.getsignal(number) != signal.SIG_IGN
        ]
        handlers = [(number, signal.signal(number, signal.default_int_handler)) for number in asked]
        try:
            while self._waiting or self.running:
                while (
                    self._waiting
                    and (free := self._jobs - sum(work.workers for work in self.running)) > 0
                ):
                    # Free workers are shared among the waiting cells.
                    workers = max(min(PER_CELL, free), free // len(self._waiting))
                    self.running.append(Work(self._folder, self._waiting.pop(0), workers))
                for work in tuple(self.running):
                    if work.has_ended():
                        self._ends(work)
                self.look()
                if self.running:
                    time.sleep(POLL)
        finally:
            # They record it; also those stop that an earlier, killed study left.
            stop_engines([(work.file, work.engine) for work in self.running])
            deadline = time.monotonic() + STOP_WAIT
            while time.monotonic() < deadline and any(
                engine_is_alive(work.path) for work in self.running
            ):
                time.sleep(POLL)
            for work in self.running:
                work.catch_up()
                work.file.close()
            for number, handler in handlers:
                signal.signal(number, handler)
            if self._live:
                # The terminal may be gone.
                with contextlib.suppress(OSError):
                    print(CLEAR, end="", file=self._out, flush=True)
            self._record()

    def _ends(self, work: Work) -> None:
        self.running.remove(work)
        self._ended.append(work)
        work.file.close()
        seed = f", seed {work.cell.seed}" if self._plan.seeds > 1 else ""
        came_to = work.problem
        if not came_to:
            result = read_cell(self._folder, work.cell)
            doubt = "" if result.minimal else f"; not certified: {result.problem}"
            tests = (
                f"{count(result.tests, 'test')} and {result.certificate_tests} for the certificate"
            )
            models = f"{len(result.elements)} → {count(len(result.left), 'model')}"
            came_to = f"{models}, {tests}, {duration(work.state.working_seconds)}{doubt}"
            if result.baseline is None:
                came_to = result.problem
        self._say(f"{self._share}  {work.cell.label}{seed}: {came_to}")

    def look(self) -> None:
        """Says how far it is, and records it from time to time."""
        now = time.monotonic()
        if now >= self._next_record:
            self._record()
            self._next_record = now + RECORD_PERIOD
        if self._live:
            line = set_cell_size(self._now(), shutil.get_terminal_size().columns - 1).rstrip()
            print(f"{CLEAR}{printable(line)}", end="", file=self._out, flush=True)
        elif now >= self._next_line and self.running:
            self._next_line = now + QUIET
            self._say(self._now())

    @property
    def _share(self) -> str:
        cells = len(self._plan.cells)
        return f"{cells - len(self._waiting) - len(self.running)}/{cells}"

    def _record(self) -> None:
        seconds = time.monotonic() - self._began
        tests = sum(work.tests for work in (*self.running, *self._ended))
        write_sessions(
            self._folder, (*self._earlier, replace(self._session, seconds=seconds, tests=tests))
        )

    def _say(self, line: str) -> None:
        print(f"{CLEAR if self._live else ''}{printable(line)}", file=self._out, flush=True)

    def _now(self) -> str:
        said = [self._share]
        for work in self.running:
            state = work.state
            doing = f"{len(state.environment)} of {len(state.elements)} models, "
            doing += f"{'certificate, ' if state.confirming else ''}{state.tests_done} tests"
            if state.baseline is None:
                doing = (
                    f"{state.tests_done} of {work.cell.scenario.reduction.baseline_runs} "
                    "baseline runs"
                )
            said.append(f"{work.cell.label}: {doing}")
        return " · ".join(said)


def conduct(plan: Plan, folder: Path, jobs: int, out: TextIO) -> int:
    """Makes the missing cells of a study in `folder` with `jobs` workers, and writes its results;
    returns the exit code.

    0 means that every cell is certified to be minimal, 1 that not all are, 130 that it was
    interrupted. Raises UserError.
    """
    for scenario in plan.scenarios:
        # A world or a robot that cannot be read is said before anything is made.
        load_parts(scenario)
    interrupted = False
    with opened(folder):
        done = {cell.name for cell in plan.cells if is_done(folder, cell)}
        cells = [cell for cell in plan.cells if cell.name not in done]
        try:
            if cells:
                Runner(plan, folder, cells, jobs, out).run()
        except KeyboardInterrupt:
            interrupted = True
        page, results = write_study(plan, folder, sessions(folder))
    for result in results:
        if result.problem and result.cell.name in done:
            print(
                printable(f"{result.cell.label}, seed {result.cell.seed}: {result.problem}"),
                file=out,
            )
    minimal = sum(result.minimal for result in results)
    print(
        printable(f"{minimal} of {count(len(results), 'cell')} certified; wrote {page}"),
        file=out,
        flush=True,
    )
    if interrupted:
        print("interrupted; the same command continues", file=sys.stderr)
        return 130
    if minimal == len(results):
        return 0
    return 1
