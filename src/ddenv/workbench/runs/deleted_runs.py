"""Runs that were deleted: they wait in a folder of their own, and can be brought back for a week."""

from __future__ import annotations

import shutil
import time
from pathlib import Path

from ddenv.errors import UserError
from ddenv.runfile.lock import engine_lock
from ddenv.runfile.store import LOGS
from ddenv.runs.folder import SUFFIX

FOLDER = ".deleted"
# The endings of files beside a run file that go with it.
BESIDE = (*LOGS, ".log", ".scene.log", ".place")
# How long a deleted run is kept, s.
KEPT = 7 * 86_400.0


def delete_run(path: Path) -> None:
    """Moves a run and the files beside it to the deleted ones; those that were deleted a week ago are gone for good.

    Raises UserError while an engine works on it, or if it cannot be moved.
    """
    with engine_lock(path):
        home = path.parent / FOLDER
        _clear(home)
        place = home / f"{time.time_ns()}"
        try:
            place.mkdir(parents=True)
            for each in (path, *(path.with_name(f"{path.name}{ending}") for ending in BESIDE)):
                if each.exists():
                    each.rename(place / each.name)
            path.with_name(f"{path.name}.lock").unlink(missing_ok=True)
        except OSError as error:
            raise UserError(f"{path}: cannot be deleted: {error.strerror}") from None


def bring_back(folder: Path) -> Path:
    """Brings back the run of `folder` that was deleted last. Raises UserError if there is none, or if its name is taken."""
    for place in sorted(_places(folder / FOLDER), reverse=True):
        run = next(place.glob(f"*{SUFFIX}"), None)
        if run is None:
            continue
        path = folder / run.name
        if path.exists():
            raise UserError(f"{path.stem}: there is a new run of this name; delete or rename that one first")
        try:
            # The run comes last: without its log it would lack its last events.
            for each in sorted(place.iterdir(), key=lambda each: each == run):
                each.rename(folder / each.name)
            place.rmdir()
        except OSError as error:
            raise UserError(f"{path}: cannot be brought back: {error.strerror}") from None
        return path
    raise UserError("there is no deleted run to bring back")


def _places(home: Path) -> list[Path]:
    """A folder for each deletion, named by its time in ns."""
    return [each for each in home.iterdir() if each.name.isdecimal()] if home.is_dir() else []


def _clear(home: Path) -> None:
    for place in _places(home):
        if int(place.name) / 1e9 < time.time() - KEPT:
            shutil.rmtree(place, ignore_errors=True)
