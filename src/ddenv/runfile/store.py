"""Reading and writing a run file (`NAME.ddenv`, SQLite in WAL mode).

The engine is the only writer of events; viewers read, and append commands. Nothing in the file is
ever executed: documents are text, event data is JSON, trajectories are rows of little-endian
float64.
"""

from __future__ import annotations

import json
import math
import os
import sqlite3
import tempfile
import time
from array import array
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ddenv.errors import UserError
from ddenv.runfile.lock import engine_lock
from ddenv.runfile.reading import LARGEST, Invalid, Pose, Real, plain, read
from ddenv.text import Data

# The classes of events are loaded with the first event that is read: a screen is shown before.
if TYPE_CHECKING:
    from ddenv.runfile.events import Created, Event

APPLICATION_ID = 0x64644531
# The format of the file. Those before the oldest one are refused; 8 has the bounds of certificates.
SCHEMA_VERSION = 8
OLDEST_VERSION = 7
# The maximum time, Unix time in s: the year 5138.
LATEST = 1e11
COLUMNS = 8  # time s, x, y, z m, quaternion w, x, y, z
# Maximum wait for another process to finish writing, s: a screen must not freeze, an engine must
# not give up.
VIEWER_WAIT = 1.0
ENGINE_WAIT = 30.0

_SCHEMA = """
CREATE TABLE document (name TEXT PRIMARY KEY, content BLOB NOT NULL) WITHOUT ROWID;
CREATE TABLE event (id INTEGER PRIMARY KEY AUTOINCREMENT, time REAL NOT NULL, kind TEXT NOT NULL, data TEXT NOT NULL);
CREATE TABLE command (id INTEGER PRIMARY KEY AUTOINCREMENT, time REAL NOT NULL, kind TEXT NOT NULL, data TEXT NOT NULL);
CREATE TABLE motion (test INTEGER NOT NULL, model TEXT NOT NULL, samples BLOB NOT NULL, PRIMARY KEY (test, model)) WITHOUT ROWID;
CREATE TABLE live (slot INTEGER PRIMARY KEY, test INTEGER NOT NULL, time REAL NOT NULL, pose TEXT NOT NULL);
"""  # noqa: E501 - what a run file has is compared with this text
_ROWS = "SELECT id, time, kind, data FROM {} WHERE id > ? ORDER BY id LIMIT ?"
_TABLES = {statement.strip() for statement in _SCHEMA.split(";") if statement.strip()}
# The endings of the files that SQLite keeps beside a run file while it is open. After a kill they
# stay.
LOGS = ("-wal", "-shm", "-journal")
# A quota, and a limit of a file's size, come as an error of writing.
_FULL = (sqlite3.SQLITE_FULL, sqlite3.SQLITE_IOERR_WRITE)
NOWHERE = (0, 0)
ROBOT = ""  # the robot's own rows in `motion`; models cannot have an empty name
# Samples by model. In place of the robot's, an implied test has the number of the test that it
# follows from, which has all of its.
Motions = dict[str, bytes | int]


@dataclass(frozen=True, slots=True)
class Recorded:
    """An event of a run file. `time` is Unix time, s; `command` is the number of the viewer's
    request that caused it.
    """

    id: int
    time: float
    event: Event
    command: int | None = None

    @property
    def kind(self) -> str:
        """The name of its kind in the file."""
        from ddenv.runfile.events import NAMES

        return NAMES[type(self.event)]

    @property
    def data(self) -> Data:
        """What the file says of it, as JSON."""
        fields: Data = plain(self.event)
        if self.command is None:
            return fields
        return fields | {"command": self.command}


@dataclass(frozen=True, slots=True)
class Request:
    """An entry of the command table: what a viewer asks of the engine. `time` is Unix time, s."""

    id: int
    time: float
    kind: str
    data: Data


@dataclass(frozen=True, slots=True, kw_only=True)
class Live:
    """A running test: simulated `time`, s, the pose (x, y, z m, qw, qx, qy, qz) of the robot, and
    those of models that moved.
    """

    slot: int
    test: int
    time: float
    pose: tuple[float, ...]
    models: Mapping[str, tuple[float, ...]] = field(default_factory=dict, hash=False)


def create(path: Path, documents: dict[str, bytes], created: Created) -> None:
    """Creates a run file atomically, with `created` as its first event. Raises UserError if it
    exists or cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    except OSError as error:
        raise UserError(f"{path}: cannot be written: {error.strerror}") from None
    os.close(handle)
    try:
        connection = sqlite3.connect(name, isolation_level=None)
        # The file gets its name once all of it is on disk, so no earlier step needs syncing.
        connection.executescript("PRAGMA synchronous = OFF; PRAGMA journal_mode = MEMORY;")
        connection.executescript(_SCHEMA)
        connection.executemany("INSERT INTO document VALUES (?, ?)", documents.items())
        _insert(connection, "event", "created", plain(created), time.time())
        connection.execute(f"PRAGMA application_id = {APPLICATION_ID}")
        connection.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
        connection.close()
        with Path(name).open("rb") as file:
            os.fsync(file.fileno())
        _forget(path)
        os.link(name, path)
    except FileExistsError:
        raise UserError(
            f"{path}: exists already; choose another name, or attach with 'ddenv open {path}'"
        ) from None
    except (OSError, sqlite3.Error) as error:
        raise UserError(f"{path}: cannot be written: {error}") from None
    finally:
        Path(name).unlink(missing_ok=True)


def _forget(path: Path) -> None:
    """Removes what a killed run of this name has left, if its file is gone: SQLite would add it to
    the new file. Raises UserError while an engine still works on the deleted file.
    """
    logs = [log for ending in LOGS if (log := path.with_name(f"{path.name}{ending}")).exists()]
    if not logs or path.exists():
        return
    with engine_lock(
        path,
        f"{path}: an engine is still working on a deleted run of this name; choose another name",
    ):
        for log in logs:
            log.unlink(missing_ok=True)


class NoRoom(UserError):
    """The disk takes no more: what was to be written is not there, and nothing else has changed."""


class RunFile:
    """An open run file. Raises UserError for a file that is missing, not a run file, or of another
    format.

    `untouched` reads the file alone: not its log, and nothing is made beside it. `wait` is how long
    another process may write, s.
    """

    def __init__(self, path: Path, untouched: bool = False, wait: float = VIEWER_WAIT) -> None:
        self.path = path
        self.address = path.resolve().as_uri()
        log = path.with_name(f"{path.name}-wal")
        # Read-only if the folder is not writable and there is no write-ahead log to merge.
        if untouched or not (log.exists() or os.access(path.parent, os.W_OK)):
            self.address += "?immutable=1"
        self._owned: tuple[int, int] | None = None
        self._logs: dict[Path, tuple[int, int]] = {}
        self._wait: Callable[[NoRoom], bool] | None = None
        if not path.is_file():
            raise UserError(f"{path}: no such run file; 'ddenv runs' lists the runs")
        try:
            self._db = sqlite3.connect(self.address, uri=True, isolation_level=None, timeout=wait)
            self._db.execute("PRAGMA trusted_schema = OFF")
        except sqlite3.Error as error:
            raise UserError(f"{path}: cannot be read: {error}") from None
        self._check()

    def _check(self) -> None:
        """Raises UserError unless the open file is a readable run file."""
        path = self.path
        try:
            application = self._db.execute("PRAGMA application_id").fetchone()[0]
            version = self._db.execute("PRAGMA user_version").fetchone()[0]
        except sqlite3.OperationalError as error:
            raise UserError(f"{path}: cannot be read: {error}") from None
        except sqlite3.Error as error:
            from zipfile import is_zipfile

            what = f"is not a ddenv run file ({error})"
            if is_zipfile(path):
                what = "is a ZIP file; unpack it first and name the run in it, FOLDER/run.ddenv"
            raise UserError(f"{path}: {what}") from None
        if application != APPLICATION_ID:
            raise UserError(f"{path}: is not a ddenv run file")
        if not OLDEST_VERSION <= version <= SCHEMA_VERSION:
            if version > SCHEMA_VERSION:
                which = "a newer ddenv"
            else:
                which = "a ddenv from before its first release"
            words = (
                f"was written by {which} (format {version}); this one reads format {SCHEMA_VERSION}"
            )
            raise UserError(f"{path}: {words}")
        # A view or trigger in place of a table could run forever.
        if {
            sql
            for (sql,) in self._all("SELECT sql FROM sqlite_master WHERE name NOT LIKE 'sqlite_%'")
        } != _TABLES:
            raise UserError(f"{path}: damaged run file: its tables are not those of a run file")

    def __enter__(self) -> RunFile:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._db.close()

    def document(self, name: str) -> bytes:
        row = self._one("SELECT content FROM document WHERE name = ?", (name,))
        if row is None or not isinstance(row[0], bytes):
            raise UserError(f"{self.path}: damaged run file: it has no document '{name}'")
        return row[0]

    def documents(self, prefix: str) -> dict[str, bytes]:
        """All documents whose names begin with `prefix`, by the rest of their names."""
        rows = self._all(
            "SELECT name, content FROM document WHERE substr(name, 1, ?) = ?", (len(prefix), prefix)
        )
        return {
            name[len(prefix) :]: content for name, content in rows if isinstance(content, bytes)
        }

    def events(self, after: int = 0, most: int = -1) -> list[Recorded]:
        """All events with an id above `after`, in order; at most `most` unless that is negative.
        Raises UserError.
        """
        return list(self.read(after, most))

    def read(self, after: int = 0, most: int = -1) -> Iterator[Recorded]:
        """The same, one after the other, so that those before a damaged one can be used."""
        try:
            for row in self._db.execute(_ROWS.format("event"), (after, most)):
                yield recorded(*row)
        except (sqlite3.Error, OverflowError) as error:
            raise _unreadable(self.path, error) from None

    def commands(self, after: int = 0) -> list[Request]:
        """The requests of viewers with an id above `after`, in order. Raises UserError."""
        return [
            Request(id, _moment(at), str(kind), _object(id, data))
            for id, at, kind, data in self._all(_ROWS.format("command"), (after, -1))
        ]

    def last_command(self) -> int:
        """The id of the last request; 0 before the first one."""
        row = self._one("SELECT max(id) FROM command")
        if row and row[0]:
            return int(row[0])
        return 0

    def send(self, kind: str, **data: Any) -> int:
        """Sends a command to the engine; returns its id. Raises UserError."""
        with self._writing() as db:
            return _insert(db, "command", kind, data, time.time())

    def motion(self, test: int) -> array[float] | None:
        """Samples of the robot in a finished test, flat rows of `COLUMNS` floats."""
        row = self._one(
            "SELECT samples FROM motion WHERE test = ? AND model = ?", (self._made(test), ROBOT)
        )
        if row is None:
            return None
        return _floats(row[0], self.path)

    def trajectory(self, test: int) -> array[float]:
        """Samples of the robot in a finished test, flat rows of `COLUMNS` floats. Raises UserError
        if there are none.
        """
        samples = self.motion(test)
        if not samples or not all(map(math.isfinite, samples)):
            raise UserError(f"{self.path}: test {test} has no trajectory in this file")
        return samples

    def motions(self, test: int) -> dict[str, array[float]]:
        """Samples of every model that moved in a finished test, by name; the robot is `ROBOT`."""
        return {
            model: _floats(samples, self.path)
            for model, samples in self.samples(self._made(test)).items()
        }

    def samples(self, test: int) -> Motions:
        """What the file has beside the end of a test, as it is there."""
        return dict(self._all("SELECT model, samples FROM motion WHERE test = ?", (test,)))

    def _made(self, test: int) -> int:
        """The test that has the samples of `test`: itself, or the one that implies it."""
        row = self._one("SELECT samples FROM motion WHERE test = ? AND model = ?", (test, ROBOT))
        if row is not None and isinstance(row[0], int):
            return row[0]
        return test

    def live(self) -> list[Live]:
        """The running tests, by worker slot."""
        found = []
        for slot, test, at, text in self._all(
            "SELECT slot, test, time, pose FROM live ORDER BY slot"
        ):
            try:
                number, time, poses = read(
                    tuple[int, Real, dict[str, Pose]], f"[{test}, {at}, {text}]"
                )
                found.append(
                    Live(slot=slot, test=number, time=time, pose=poses.pop(ROBOT), models=poses)
                )
            except (Invalid, KeyError):
                raise UserError(
                    f"{self.path}: damaged run file: the pose of a running test is invalid"
                ) from None
        return found

    # For the engine alone.

    def own(self, wait: Callable[[NoRoom], bool] | None = None) -> None:
        """Prepares for writing: readers are never blocked, and a killed engine loses no committed
        event. Where the disk has no room for an event, `wait` is called; it returns whether to try
        again.
        """
        self._owned = _identity(self.path)
        self._wait = wait
        self._db.execute(f"PRAGMA busy_timeout = {ENGINE_WAIT * 1000:.0f}")
        with self._writing() as db:
            db.execute("DELETE FROM live")
            # What is written from now on, earlier versions of ddenv cannot read.
            db.execute(f"PRAGMA user_version = {SCHEMA_VERSION}")
        self._db.execute("PRAGMA journal_mode = WAL")
        self._db.execute("PRAGMA synchronous = NORMAL")

    def append(
        self,
        event: Event,
        motions: Motions | None = None,
        command: int | None = None,
        number: int | None = None,
    ) -> Recorded:
        """Records one event, with the trajectories of its test, in one transaction; `command` is
        the number of what caused it. The trajectories of a run that is no test need a `number`,
        which is negative. Raises UserError if the run file was deleted or replaced meanwhile:
        SQLite would go on to write what nobody can read.
        """
        from ddenv.runfile.events import Implied, TestFinished

        test = event.test if isinstance(event, TestFinished | Implied) else number
        new = Recorded(0, time.time(), event, command)
        while not new.id:
            try:
                with self._writing() as db:
                    db.execute("BEGIN IMMEDIATE")
                    id = _insert(db, "event", new.kind, new.data, new.time)
                    rows = [
                        (test, model, samples)
                        for model, samples in (motions or {}).items()
                        if test is not None
                    ]
                    db.executemany("INSERT OR REPLACE INTO motion VALUES (?, ?, ?)", rows)
                    db.execute("COMMIT")
                new = replace(new, id=id)
            except NoRoom as full:
                if self._wait is None or not self._wait(full):
                    raise
        if not self._logs:
            logs = [self.path.with_name(f"{self.path.name}{ending}") for ending in LOGS]
            self._logs = {log: _identity(log) for log in logs if log.exists()}
        return new

    def set_live(self, running: list[Live]) -> None:
        """Replaces the table of running tests."""
        rows = [
            (live.slot, live.test, live.time, json.dumps({ROBOT: live.pose, **live.models}))
            for live in running
        ]
        # It only shows what is replaced soon.
        with suppress(NoRoom), self._writing() as db:
            db.execute("BEGIN IMMEDIATE")
            db.execute("DELETE FROM live")
            db.executemany("INSERT INTO live VALUES (?, ?, ?, ?)", rows)
            db.execute("COMMIT")

    def settle(self) -> None:
        """Merges the write-ahead log into the run file, so that the run is one file again."""
        with suppress(NoRoom), self._writing() as db:
            db.execute("PRAGMA wal_checkpoint(TRUNCATE)")

    def _one(self, query: str, values: tuple[Any, ...] = ()) -> tuple[Any, ...] | None:
        rows = self._all(query, values)
        if rows:
            return rows[0]
        return None

    def _all(self, query: str, values: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
        try:
            return self._db.execute(query, values).fetchall()
        except (sqlite3.Error, OverflowError) as error:
            raise _unreadable(self.path, error) from None

    @contextmanager
    def _writing(self) -> Iterator[sqlite3.Connection]:
        if self._owned is not None and (now := _identity(self.path)) != self._owned:
            # The log goes into the file, wherever that is now, and away: SQLite would add it to
            # another file of this name.
            with suppress(sqlite3.Error):
                self._db.execute("PRAGMA wal_checkpoint(TRUNCATE)")
            for log, identity in self._logs.items():
                if _identity(log) == identity:
                    log.unlink(missing_ok=True)
            what = "deleted or moved" if now == NOWHERE else "replaced by another file"
            said = f"the run file was {what} while an engine worked on it; nothing more is written"
            raise UserError(f"{self.path}: {said}")
        try:
            yield self._db
        except sqlite3.Error as error:
            if self._db.in_transaction:
                self._db.execute("ROLLBACK")
            kind = NoRoom if error.sqlite_errorcode in _FULL else UserError
            raise kind(f"{self.path}: cannot be written: {error}; its content is intact") from None


def _unreadable(path: Path, error: Exception) -> UserError:
    locked = f"cannot be read now: {error} by another program; try again"
    return UserError(
        f"{path}: {locked if 'locked' in str(error) else f'damaged run file: {error}'}"
    )


def recorded(id: Any, at: Any, kind: Any, data: Any) -> Recorded:
    """A row of the event table. Raises UserError, with what is wrong where."""
    from ddenv.runfile.events import KINDS

    try:
        content = _object(id, data)
        command = content.pop("command", None)
        if kind not in KINDS:
            raise Invalid(f"is of an unknown kind {str(kind)[:40]!a}")
        if command is not None and (type(command) is not int or not 0 <= command <= LARGEST):
            raise Invalid("command: should be a whole number")
        event = read(KINDS[kind], data if command is None else json.dumps(content))
        return Recorded(int(id), _moment(at), event, command)
    except Invalid as invalid:
        named = f" ({kind})" if kind in KINDS else ""
        raise UserError(f"damaged run file: event {id}{named}: {invalid}") from None


def _object(id: Any, data: Any) -> Data:
    with suppress(ValueError, TypeError, RecursionError):
        content = json.loads(data)
        if isinstance(content, dict):
            return content
    raise UserError(f"damaged run file: entry {id} is not a JSON object")


def _moment(value: Any) -> float:
    """A Unix time, s, that a calendar can show."""
    if type(value) not in (int, float) or not 0 <= value < LATEST:
        raise UserError("damaged run file: the time of an entry is not a date")
    return float(value)


def _insert(db: sqlite3.Connection, table: str, kind: str, data: Data, at: float) -> int:
    text = json.dumps(data, allow_nan=False, separators=(",", ":"))
    cursor = db.execute(
        f"INSERT INTO {table} (time, kind, data) VALUES (?, ?, ?)", (at, kind, text)
    )
    assert cursor.lastrowid is not None
    return cursor.lastrowid


def _identity(path: Path) -> tuple[int, int]:
    try:
        found = os.stat(path)  # noqa: PTH116  (at each write, and twice as fast)
    except OSError:
        return NOWHERE
    return found.st_dev, found.st_ino


def _floats(samples: object, path: Path) -> array[float]:
    values = array("d")
    if not isinstance(samples, bytes) or len(samples) % (8 * COLUMNS):
        raise UserError(f"{path}: damaged run file: a trajectory is cut short")
    values.frombytes(samples)
    # What is no number at all is passed over where it is drawn.
    if any(abs(value) > LARGEST for value in values):
        raise UserError(f"{path}: damaged run file: a trajectory goes too far")
    return values
