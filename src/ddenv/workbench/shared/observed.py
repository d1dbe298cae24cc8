"""A run file as a screen reads it: nothing is written, not even beside it, and no look waits for a
writer.
"""

from __future__ import annotations

import os
import sqlite3
from pathlib import Path
from typing import Any

from ddenv.errors import UserError
from ddenv.runfile.store import RunFile

# Maximum time to wait for the file, s; a look that fails is soon repeated.
PATIENCE = 0.02
_BUSY = (sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED)


class Busy(UserError):
    """Another program is writing: what was read before stays valid."""


class Gone(UserError):
    """The run file was deleted, or another file was put in its place."""


class Observed(RunFile):
    """An open run file that is never written. Raises UserError for what is no run file.

    `strictly` does not even touch the log's index, which must be rebuilt after a crash.
    """

    def __init__(self, path: Path, strictly: bool = False) -> None:
        if not path.is_file():
            raise UserError(f"{path}: no such run file; 'ddenv runs' lists the runs")
        self.path = path
        self._strictly = strictly
        self._origin = _place(path)
        self._version = 0
        self._place = self._origin
        self._open(self._origin)
        self._check()

    def refresh(self) -> bool:
        """Whether there may be something new since the last call. Raises Gone, Busy, or UserError
        if it cannot be read.
        """
        place = _place(self.path)
        if place[:2] != self._origin[:2]:
            raise Gone(
                f"{self.path}: the run file was {'replaced' if place[1] else 'deleted'} while it "
                "was open"
            )
        if place != self._place:
            # Without a log the file is open as immutable; now somebody writes it.
            self._db.close()
            self._open(place)
            return True
        version = int(self._all("PRAGMA data_version")[0][0])
        changed = version != self._version
        self._version = version
        return changed

    def send(self, kind: str, **data: Any) -> int:
        """As `RunFile.send`; may wait for another writer."""
        if _place(self.path)[:2] != self._origin[:2]:
            raise Gone(f"{self.path}: the run file is gone")
        with RunFile(self.path) as file:
            return file.send(kind, **data)

    def tidy(self) -> None:
        """Closes it; the last one to do so folds the log back, so that the run is one file
        again.
        """
        self.close()
        place = _place(self.path)
        if place[:2] == self._origin[:2] and place[2] and os.access(self.path.parent, os.W_OK):
            RunFile(self.path).close()

    def _open(self, place: _Place) -> None:
        _, _, logged, shared, _ = place
        if logged and not shared and self._strictly:
            raise UserError(
                f"{self.path}: its last writer crashed; open it once without --watch to repair it"
            )
        # All connections of a process share one index: while this one cannot write it, none can,
        # and nothing could be sent.
        index = "&readonly_shm=1" if shared and self._strictly else ""
        how = f"mode=ro{index}" if logged else "immutable=1"
        address = f"{self.path.resolve().as_uri()}?{how}"
        self._version = 0
        try:
            self._db = sqlite3.connect(address, uri=True, isolation_level=None, timeout=PATIENCE)
            self._db.execute("PRAGMA trusted_schema = OFF")
        except sqlite3.Error as error:
            raise UserError(f"{self.path}: cannot be read: {error}") from None
        self._place = place

    def _all(self, query: str, values: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
        try:
            return self._db.execute(query, values).fetchall()
        except (sqlite3.Error, OverflowError) as error:
            if (
                isinstance(error, sqlite3.OperationalError)
                and error.sqlite_errorcode & 0xFF in _BUSY
            ):
                raise Busy(f"{self.path}: another program is writing") from None
            raise UserError(f"{self.path}: damaged run file: {error}") from None


# Device and inode, whether there is a log with something in it, whether that has an index, and the
# file's own age and size.
_Place = tuple[int, int, bool, bool, tuple[int, int]]


def _place(path: Path) -> _Place:
    file = _stat(path)
    log = _stat(f"{path}-wal")
    if file is None:
        return 0, 0, False, False, (0, 0)
    shared = log is not None and _stat(f"{path}-shm") is not None
    logged = shared or (log is not None and log.st_size > 0)
    # With a log the file's own age and size say nothing about new events.
    return (
        file.st_dev,
        file.st_ino,
        logged,
        shared,
        (0, 0) if logged else (file.st_mtime_ns, file.st_size),
    )


def _stat(path: str | Path) -> os.stat_result | None:
    try:
        return os.stat(path)  # noqa: PTH116  (called ten times a second, and twice as fast)
    except OSError:
        return None
