"""The folder of a study: its run files, its reports, and when and on which machine it was made."""

from __future__ import annotations

import json
import os
import platform
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from pydantic import TypeAdapter

from ddenv import __version__
from ddenv.errors import UserError
from ddenv.runfile.lock import held
from ddenv.runs import processor
from ddenv.runs.folder import SUFFIX
from ddenv.study.plan import Cell
from ddenv.text import count
from ddenv.world.access import read_bytes, write_file

RUNS, ABOUT, LOCK = "runs", "study.json", "study.lock"
# The numbers of a run come from these: another version may give another result.
PACKAGES = ("drake", "numpy", "scipy", "scikit-learn")
# A machine's name may be anything.
LONGEST_NAME = 120


@dataclass(frozen=True, slots=True)
class Sitting:
    """One session of work on the study. `begun` is Unix time, s; `seconds` and `tests` count this session so far."""

    begun: float
    seconds: float
    jobs: int
    tests: int
    versions: str
    machine: str


_SITTINGS = TypeAdapter(tuple[Sitting, ...])


def run_path(folder: Path, cell: Cell) -> Path:
    """The run file of a cell."""
    return folder / RUNS / f"{cell.name}{SUFFIX}"


@contextmanager
def opened(folder: Path) -> Iterator[None]:
    """Creates the folder if needed, and locks it against other studies. Raises UserError."""
    try:
        if folder.exists() and not folder.is_dir():
            raise UserError(f"{folder}: is a file; give the name of a folder")
        if folder.is_dir() and any(folder.iterdir()) and not (folder / ABOUT).exists() and not (folder / LOCK).exists():
            raise UserError(f"{folder}: contains other files; give the name of a new or empty folder")
        (folder / RUNS).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UserError(f"{folder}: cannot be written: {error.strerror}; choose another folder with -o") from None
    if not os.access(folder / RUNS, os.W_OK):
        raise UserError(f"{folder}: cannot be written: no permission; choose another folder with -o")
    taken = f"{folder}: another study is running in this folder; wait for it, or choose another folder with -o"
    with held(folder / LOCK, taken, f"{folder}: cannot be written", "choose another folder with -o"):
        yield


def sittings(folder: Path) -> tuple[Sitting, ...]:
    """The sessions of work on the study so far. Raises UserError for a damaged file."""
    path = folder / ABOUT
    if not path.exists():
        return ()
    try:
        return _SITTINGS.validate_python(json.loads(read_bytes(path))["sittings"])
    except (ValueError, TypeError, KeyError, RecursionError):
        raise UserError(f"{path}: is damaged; delete it (the runs are not affected)") from None


def write_sittings(folder: Path, all_of_them: tuple[Sitting, ...]) -> None:
    """Writes them as a whole or not at all."""
    text = json.dumps({"sittings": [asdict(each) for each in all_of_them]}, indent=1)
    write_file(folder / ABOUT, text.encode())


def versions() -> str:
    """The versions of ddenv, Python and the packages that compute; imports none of them."""
    found = [f"ddenv {__version__}", f"Python {platform.python_version()}"]
    for name in PACKAGES:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            continue
    return ", ".join(found)


def machine() -> str:
    """The processor, its cores and the system."""
    cores = count(processor.usable_cores(), "core")
    name = processor.name()[:LONGEST_NAME]
    return f"{name}, {cores}, {platform.system()}" if name else cores
