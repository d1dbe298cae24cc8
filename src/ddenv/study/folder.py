"""The folder of a study: who may work in it, and the sessions of work on it."""

from __future__ import annotations

import platform
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

from pydantic import TypeAdapter

from ddenv import __version__
from ddenv.errors import UserError
from ddenv.runfile.lock import held
from ddenv.runs import processor
from ddenv.study.plan import RUNS
from ddenv.text import count
from ddenv.world.access import read_bytes, write_file

ABOUT = "study.json"
LOCK = "study.lock"
# A machine's name may be anything.
LONGEST_NAME = 120


@contextmanager
def opened(folder: Path) -> Iterator[None]:
    """Creates the folder if needed, and locks it against other studies. Raises UserError."""
    refused = f"{folder}: cannot be written"
    instead = "choose another folder with -o"
    try:
        if folder.exists() and not folder.is_dir():
            raise UserError(f"{folder}: is a file; give the name of a folder")
        if (
            folder.is_dir()
            and any(folder.iterdir())
            and not (folder / ABOUT).exists()
            and not (folder / LOCK).exists()
        ):
            raise UserError(
                f"{folder}: contains other files; give the name of a new or empty folder"
            )
        (folder / RUNS).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{refused}: {error.strerror}; {instead}") from None
    taken = f"{folder}: another study is running in this folder; wait for it, or {instead}"
    with held(folder / LOCK, taken, refused, instead):
        yield


@dataclass(frozen=True, slots=True, kw_only=True)
class Session:
    """One session of work on the study. `begun` is Unix time, s; `seconds` and `tests` count this
    session so far.
    """

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
    """The versions of ddenv, Python and the packages that compute: another one may give another
    result.
    """
    packages = processor.versions("drake", "numpy", "scipy", "scikit-learn")
    return f"ddenv {__version__}, Python {platform.python_version()}, {packages}"


def machine() -> str:
    """The processor, its cores and the system."""
    cores = count(processor.usable_cores(), "core")
    name = processor.name()[:LONGEST_NAME]
    if name:
        return f"{name}, {cores}, {platform.system()}"
    return cores
