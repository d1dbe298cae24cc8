"""Works in the folder of a study: runs its cells, several at the same time, each with its own engine, and records its sessions."""

from __future__ import annotations

import contextlib
import os
import platform
import signal
import subprocess
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from pydantic import TypeAdapter

from ddenv import __version__
from ddenv.errors import UserError
from ddenv.evidence.claims import current
from ddenv.runfile.fold import fold
from ddenv.runfile.lock import engine_is_alive, held
from ddenv.runfile.state import BROKEN, RunState
from ddenv.runfile.store import RunFile
from ddenv.runs import processor
from ddenv.runs.creation import create_run
from ddenv.runs.programs import STOP_WAIT, last_words, start_engine, stop_engines
from ddenv.study.plan import RUNS, Cell, run_path
from ddenv.study.results import difference
from ddenv.text import count
from ddenv.world.access import read_bytes, write_file

ABOUT, LOCK = "study.json", "study.lock"
# The numbers of a run come from these: another version may give another result.
PACKAGES = ("drake", "numpy", "scipy", "scikit-learn")
# A machine's name may be anything.
LONGEST_NAME = 120
POLL = 0.2
# With more workers, most of the additional tests are not needed.
PER_CELL = 2


@contextmanager
def opened(folder: Path) -> Iterator[None]:
    """Creates the folder if needed, and locks it against other studies. Raises UserError."""
    refused, instead = f"{folder}: cannot be written", "choose another folder with -o"
    try:
        if folder.exists() and not folder.is_dir():
            raise UserError(f"{folder}: is a file; give the name of a folder")
        if folder.is_dir() and any(folder.iterdir()) and not (folder / ABOUT).exists() and not (folder / LOCK).exists():
            raise UserError(f"{folder}: contains other files; give the name of a new or empty folder")
        (folder / RUNS).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{refused}: {error.strerror}; {instead}") from None
    if not os.access(folder / RUNS, os.W_OK):
        raise UserError(f"{refused}: no permission; {instead}")
    taken = f"{folder}: another study is running in this folder; wait for it, or {instead}"
    with held(folder / LOCK, taken, refused, instead):
        yield


@dataclass(frozen=True, slots=True)
class Session:
    """One session of work on the study. `begun` is Unix time, s; `seconds` and `tests` count this session so far."""

    begun: float
    seconds: float
    jobs: int
    tests: int
    versions: str
    machine: str


_SESSIONS = TypeAdapter(dict[str, tuple[Session, ...]])


def sessions(folder: Path) -> tuple[Session, ...]:
    """The sessions of work on the study so far. Raises UserError for a damaged file."""
    path = folder / ABOUT
    if not path.exists():
        return ()
    try:
        return _SESSIONS.validate_json(read_bytes(path))["sittings"]
    except (ValueError, KeyError):
        raise UserError(f"{path}: is damaged; delete it (the runs are not affected)") from None


def write_sessions(folder: Path, all_of_them: tuple[Session, ...]) -> None:
    """Writes them as a whole or not at all."""
    write_file(folder / ABOUT, _SESSIONS.dump_json({"sittings": all_of_them}, indent=1))


def versions() -> str:
    """The versions of ddenv, Python and the packages that compute; imports none of them."""
    known = [f"ddenv {__version__}", f"Python {platform.python_version()}"]
    for name in PACKAGES:
        with contextlib.suppress(PackageNotFoundError):
            known.append(f"{name} {version(name)}")
    return ", ".join(known)


def machine() -> str:
    """The processor, its cores and the system."""
    cores = count(processor.usable_cores(), "core")
    name = processor.name()[:LONGEST_NAME]
    return f"{name}, {cores}, {platform.system()}" if name else cores


@dataclass
class Work:
    """A cell in work by so many `workers`, since its run was as `before`.

    `engine` is None while an engine of another study works on it. `problem` says why it did not end this time.
    """

    cell: Cell
    path: Path
    workers: int
    file: RunFile
    before: RunState
    state: RunState
    engine: subprocess.Popen[bytes] | None = None
    problem: str = ""

    @property
    def tests(self) -> int:
        """How many tests this session has made, and not reused from another cell."""
        return _made(self.state) - _made(self.before)

    def catch_up(self) -> None:
        """Reads the new events."""
        self.state = fold(self.file.events(self.state.revision), self.state)

    def has_ended(self) -> bool:
        """Whether no engine works on it any more."""
        # This comes before the events are read, so none is missed. The engine of a killed study may have started just before ours,
        # and then ours gave up.
        at_work = (self.engine is not None and self.engine.poll() is None) or engine_is_alive(self.path)
        self.catch_up()
        if not at_work and self.state.status != "finished":
            # If an engine died before it wrote anything, the reason in the file is an earlier engine's.
            said = self.state.ended and self.state.revision > self.before.revision
            self.problem = self.state.reason if said else last_words(self.path)
        return not at_work


def _made(state: RunState) -> int:
    return state.made - sum(test.taken for test in state.tests)


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


def _all_broke(state: RunState) -> bool:
    """Whether the simulator broke in all baseline runs: it may work now."""
    broke = all(test.outcome in BROKEN for test in state.finished_tests)
    return state.status == "finished" and state.baseline is None and broke


def make_cells(folder: Path, cells: Sequence[Cell], jobs: int, look: Look) -> None:
    """Makes `cells` with `jobs` workers in all; cells that take long should come first.

    `look(running, waiting, ended)` is called several times a second. On KeyboardInterrupt the engines are stopped, and it
    is raised again. Raises UserError if a run file cannot be created, and then stops the engines, too.
    """
    waiting = list(cells)
    running: list[Work] = []
    ended: list[Work] = []
    # Ignored signals stay ignored: a study under nohup outlives its terminal.
    asked = [number for number in (signal.SIGTERM, signal.SIGHUP) if signal.getsignal(number) != signal.SIG_IGN]
    handlers = [(number, signal.signal(number, _interrupt)) for number in asked]
    try:
        while waiting or running:
            while waiting and (free := jobs - sum(work.workers for work in running)) > 0:
                # Free workers are shared among the waiting cells.
                workers = max(min(PER_CELL, free), free // len(waiting))
                running.append(_begin(folder, waiting.pop(0), workers))
            for work in tuple(running):
                if work.has_ended():
                    running.remove(work)
                    ended.append(work)
                    work.file.close()
            look(running, waiting, ended)
            if running:
                time.sleep(POLL)
    finally:
        _stop(running)
        # The terminal may be gone.
        with contextlib.suppress(OSError):
            look(running, waiting, ended)
        for work in running:
            work.file.close()
        for number, handler in handlers:
            signal.signal(number, handler)


def _interrupt(*_: object) -> None:
    raise KeyboardInterrupt


def _begin(folder: Path, cell: Cell, workers: int) -> Work:
    path = run_path(folder, cell)
    if path.exists():
        with RunFile(path) as old:
            all_broke = _all_broke(fold(old.events()))
        if all_broke:
            path.unlink()
    if not path.exists():
        create_run(cell.scenario, path)
    file = RunFile(path)
    state = fold(file.events())
    engine = None
    if not engine_is_alive(path) and not _is_over(state):
        engine = start_engine(path, workers, accept_mode="automatic", share=path.parent)
    return Work(cell, path, workers, file, state, state, engine)


def _stop(running: Sequence[Work]) -> None:
    """Stops engines, which record it."""
    # On cells without an engine of ours, the engine of an earlier, killed study works.
    left = [work for work in running if work.engine is None and engine_is_alive(work.path)]
    for work in left:
        with contextlib.suppress(UserError):
            work.file.send("stop")
    stop_engines([(work.file, work.engine) for work in running if work.engine is not None])
    deadline = time.monotonic() + STOP_WAIT
    while time.monotonic() < deadline and any(engine_is_alive(work.path) for work in left):
        time.sleep(POLL)
    for work in running:
        work.catch_up()
