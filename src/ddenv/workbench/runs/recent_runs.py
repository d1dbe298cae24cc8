"""The runs in the runs folder and their states, last changed first. Reading them writes nothing."""

from __future__ import annotations

import time
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from ddenv.errors import UserError
from ddenv.runfile.lock import engine_is_alive
from ddenv.runfile.run_settings import settings
from ddenv.runfile.state import RunState
from ddenv.text import Names
from ddenv.words.signs import STATUS

# The maximum number of runs in the list of the setup screen.
SHOWN = 40
# What SQLite says about a file that another program has locked.
LOCKED = "database is locked"
# The states in which no engine is expected.
ENDED = ("created", "finished", "stopped", "failed")


@dataclass(frozen=True, slots=True)
class Recent:
    """One run. `status` is the state's, "lost" if its engine has died, or "" if it is not read yet.

    `changed` is Unix time, s. `computed` is the time that its own simulations took, s. `chosen`
    is its scenario as it is now. `trouble` says why it cannot be opened.
    """

    path: Path
    changed: float
    status: str = ""
    scenario: str = ""
    algorithm: str = ""
    pair: str = ""
    total: int = 0
    kept: Names = ()
    tests: int = 0
    decisions: int = 0
    minimal: bool = False
    reason: str = ""
    trouble: str = ""
    computed: float = 0.0
    chosen: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)

    @property
    def sign(self) -> str:
        return "✗" if self.trouble else STATUS.get(self.status, ("·", ""))[0]

    @property
    def state_words(self) -> str:
        if self.trouble:
            return "cannot be read"
        if self.status == "finished":
            return "minimal" if self.minimal else "finished"
        return STATUS.get(self.status, ("", self.status or "..."))[1]

    @property
    def brief(self) -> str:
        """How many models are left, for a list in which its sign is its state."""
        return f"{len(self.kept)}/{self.total}" if self.total else ""

    @property
    def is_worked_on(self) -> bool:
        return bool(self.status) and self.status not in (*ENDED, "lost")


@dataclass(slots=True)
class _Read:
    """A file's run when the file had this `stamp`; while an engine works on it, also its `state`, to read on from there."""

    stamp: tuple[int, ...]
    recent: Recent
    state: RunState | None = None


class RunsFolder:
    """A folder of runs, read repeatedly: each time only changed files, and only their new events."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._read: dict[Path, _Read] = {}

    def look(self, patience: float = float("inf"), most: int | None = None) -> list[Recent]:
        """The last changed runs, at most `most`. After `patience` s the rest waits for the next call, with `status` "".

        Not for the screen's thread.
        """
        stamps: dict[Path, tuple[int, ...]] = {}
        with suppress(OSError):
            for path in self._folder.glob("[!.]*.ddenv"):
                with suppress(OSError):
                    stamps[path] = _stamp(path)
        self._read = {path: read for path, read in self._read.items() if path in stamps}
        latest = sorted(stamps, key=lambda path: (-stamps[path][0], path.name))[:most]
        until = time.monotonic() + patience
        found = [self._look(path, stamps[path], until) for path in latest]
        return sorted(found, key=lambda recent: (-recent.changed, recent.path.name))

    def _look(self, path: Path, stamp: tuple[int, ...], until: float) -> Recent:
        read = self._read.get(path)
        if (read is None or read.stamp != stamp) and time.monotonic() < until:
            last, read = read, _read(path, stamp, read.state if read else None)
            # A file that another program has locked is read again at the next call.
            read = last if last is not None and not read.stamp else read
            self._read[path] = read
        if read is None:
            return Recent(path, stamp[0] / 1e9)
        recent = read.recent
        if not recent.trouble and recent.status not in ENDED and not engine_is_alive(path):
            # A run without an engine does not change, so its state is not kept.
            read.state = None
            return replace(recent, status="lost")
        return recent


def _stamp(path: Path) -> tuple[int, ...]:
    """When a run file and its log were changed, in ns, and how large they are: it is read again if one of these differs."""
    file, log = path.stat(), path.with_name(f"{path.name}-wal")
    with suppress(OSError):
        logged = log.stat()
        return (max(file.st_mtime_ns, logged.st_mtime_ns), file.st_size, logged.st_mtime_ns, logged.st_size)
    return (file.st_mtime_ns, file.st_size, 0, 0)


def _read(path: Path, stamp: tuple[int, ...], state: RunState | None) -> _Read:
    # The setup screen is on the terminal before runs are read.
    from ddenv.runfile.fold import fold
    from ddenv.workbench.shared.observed import Busy, Observed

    age = stamp[0] / 1e9
    try:
        with Observed(path) as file:
            state = fold(file.events(state.revision if state else 0), state)
    except UserError as error:
        locked = isinstance(error, Busy) or LOCKED in str(error)
        return _Read(() if locked else stamp, Recent(path, age, trouble=str(error)))
    options = settings(state)
    recent = Recent(
        path,
        state.updated_at or age,
        status=state.status,
        scenario=options.name,
        algorithm=options.algorithm,
        pair=options.pair,
        total=len(state.elements),
        kept=state.environment,
        tests=state.tests_done,
        decisions=len(state.decisions),
        minimal=state.minimal,
        reason=state.reason,
        computed=computed(state),
        chosen=state.scenario,
    )
    return _Read(stamp, recent, None if state.ended else state)


def computed(state: RunState) -> float:
    """How long the simulations of a run took, s; results that were copied or implied cost nothing."""
    return sum(test.wall_seconds for test in state.tests if not test.taken and test.implied_by is None)
