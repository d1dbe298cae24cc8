"""The runs in the runs folder and their states, last changed first. Reading them writes nothing."""

from __future__ import annotations

import time
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from ddenv.errors import UserError
from ddenv.runfile.lock import engine_is_alive
from ddenv.runfile.state import RunState
from ddenv.runs.recent import ENDED, Recent, recent_of

# The maximum number of runs in the list of the setup screen.
SHOWN = 40
# What SQLite says about a file that another program has locked.
LOCKED = "database is locked"


@dataclass(slots=True)
class _Read:
    """A file's run when the file had this `stamp`; while an engine works on it, also its `state`,
    to read on from there.
    """

    stamp: tuple[int, ...]
    recent: Recent
    state: RunState | None = None


class RunsFolder:
    """A folder of runs, read repeatedly: each time only changed files, and only their new
    events.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._read: dict[Path, _Read] = {}

    def look(self, patience: float = float("inf"), most: int | None = None) -> list[Recent]:
        """The last changed runs, at most `most`. After `patience` s the rest waits for the next
        call, with `status` "".

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
            last = read
            read = _read(path, stamp, read.state if read else None)
            # A file that another program has locked is read again at the next call.
            read = last if last is not None and not read.stamp else read
            self._read[path] = read
        if read is None:
            return Recent(path=path, changed=stamp[0] / 1e9)
        recent = read.recent
        if not recent.trouble and recent.status not in ENDED and not engine_is_alive(path):
            # A run without an engine does not change, so its state is not kept.
            read.state = None
            return replace(recent, status="lost")
        return recent


def _stamp(path: Path) -> tuple[int, ...]:
    """When a run file and its log were changed, in ns, and how large they are: it is read again if
    one of these differs.
    """
    file = path.stat()
    log = path.with_name(f"{path.name}-wal")
    with suppress(OSError):
        logged = log.stat()
        return (
            max(file.st_mtime_ns, logged.st_mtime_ns),
            file.st_size,
            logged.st_mtime_ns,
            logged.st_size,
        )
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
        return _Read(() if locked else stamp, Recent(path=path, changed=age, trouble=str(error)))
    return _Read(stamp, recent_of(path, state, age), None if state.ended else state)
