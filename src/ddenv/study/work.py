"""Runs the cells of a study, several at the same time, each with its own engine; continues existing run files."""

from __future__ import annotations

import contextlib
import signal
import subprocess
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from ddenv.errors import UserError
from ddenv.evidence.claims import current
from ddenv.runfile.fold import fold
from ddenv.runfile.lock import engine_is_alive
from ddenv.runfile.state import BROKEN, RunState
from ddenv.runfile.store import RunFile
from ddenv.runs.creation import create_run
from ddenv.runs.programs import STOP_WAIT, last_words, start_engine, stop_engines
from ddenv.study.plan import Cell
from ddenv.study.results import difference
from ddenv.study.study_folder import run_path

POLL = 0.2
# With more workers, most of the additional tests are not needed.
PER_CELL = 2


@dataclass
class Work:
    """A cell in work, with this number of `workers`. `engine` is None while an engine of another study works on it.

    `problem` says why it did not end this time. Earlier studies made `made_before` tests, and its last event was number
    `known`.
    """

    cell: Cell
    path: Path
    workers: int
    file: RunFile
    state: RunState = field(default_factory=RunState)
    engine: subprocess.Popen[bytes] | None = None
    problem: str = ""
    made_before: int = 0
    known: int = 0


Look = Callable[[Sequence[Work], Sequence[Cell], Sequence[Work]], None]


def is_done(folder: Path, cell: Cell) -> bool:
    """Whether nothing is left to do for a cell. Raises UserError if its run file has other settings."""
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
        raise UserError(f"{path}: was made with {other}; choose another folder with -o, or delete {path.parent}")
    return _is_over(state) and not _all_broke(state) and not engine_is_alive(path)


def _is_over(state: RunState) -> bool:
    """Whether an engine has nothing to do: it makes tests again that broke, if the certificate is open without them."""
    certificate = current(state)
    broke = certificate is not None and any(claim.verdict == "unknown" for claim in certificate.claims)
    return state.status == "finished" and not broke


def work(folder: Path, cells: Sequence[Cell], jobs: int, look: Look) -> None:
    """Makes `cells` with `jobs` workers in all; cells that take long should come first.

    `look(running, waiting, ended)` is called several times a second. On KeyboardInterrupt the engines are stopped, and it
    is raised again. Raises UserError if a run file cannot be created, and then stops the engines, too.
    """
    waiting = list(cells)
    running: list[Work] = []
    ended: list[Work] = []
    # Ignored signals stay ignored: a study under nohup outlives its terminal.
    asked = [each for each in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(each) != signal.SIG_IGN]
    before = [(each, signal.signal(each, _interrupt)) for each in asked]
    try:
        while waiting or running:
            while waiting and (free := jobs - sum(each.workers for each in running)) > 0:
                # Free workers are shared among the waiting cells.
                workers = max(min(PER_CELL, free), free // len(waiting))
                running.append(_begin(folder, waiting.pop(0), workers))
            for each in tuple(running):
                if _has_ended(each):
                    running.remove(each)
                    ended.append(each)
                    each.file.close()
            look(running, waiting, ended)
            if running:
                time.sleep(POLL)
    finally:
        _stop(running)
        # The terminal may be gone.
        with contextlib.suppress(OSError):
            look(running, waiting, ended)
        for each in running:
            each.file.close()
        for number, handler in before:
            signal.signal(number, handler)


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt


def _begin(folder: Path, cell: Cell, workers: int) -> Work:
    path = run_path(folder, cell)
    if path.exists():
        with RunFile(path) as file:
            all_broke = _all_broke(fold(file.events()))
        if all_broke:
            path.unlink()
    if not path.exists():
        create_run(cell.scenario, path)
    each = Work(cell, path, workers, RunFile(path))
    each.state = fold(each.file.events())
    each.made_before = tests_made(each.state)
    each.known = each.state.revision
    if not engine_is_alive(path) and not _is_over(each.state):
        each.engine = start_engine(path, workers, accept_mode="automatic", share=path.parent)
    return each


def _has_ended(each: Work) -> bool:
    """Reads a cell's new events."""
    # This comes before the events are read, so none is missed. The engine of a killed study may have started just before ours, and
    # then ours gave up.
    at_work = (each.engine is not None and each.engine.poll() is None) or engine_is_alive(each.path)
    each.state = fold(each.file.events(each.state.revision), each.state)
    if at_work:
        return False
    if each.state.status != "finished":
        # If an engine died before it wrote anything, the reason in the file is an earlier engine's.
        ended = each.state.ended and each.state.revision > each.known
        each.problem = each.state.reason if ended else last_words(each.path)
    return True


def _all_broke(state: RunState) -> bool:
    """Whether the simulator broke in all baseline runs: it may work now."""
    broke = all(test.outcome in BROKEN for test in state.finished_tests)
    return state.status == "finished" and state.baseline is None and broke


def tests_made(state: RunState) -> int:
    """How many tests were made in a run, and not reused from another one."""
    return state.made - sum(test.taken for test in state.tests)


def _stop(running: Sequence[Work]) -> None:
    """Stops engines, which record it."""
    # On cells without an engine of ours, the engine of an earlier, killed study works.
    left = [each for each in running if each.engine is None and engine_is_alive(each.path)]
    for each in left:
        with contextlib.suppress(UserError):
            each.file.send("stop")
    stop_engines([(each.file, each.engine) for each in running if each.engine is not None])
    deadline = time.monotonic() + STOP_WAIT
    while time.monotonic() < deadline and any(engine_is_alive(each.path) for each in left):
        time.sleep(POLL)
    for each in running:
        each.state = fold(each.file.events(each.state.revision), each.state)
