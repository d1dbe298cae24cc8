"""Lets only one engine work on a run: a lock on a file beside it, which the system releases however
the engine ends.
"""

from __future__ import annotations

import os
import stat
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ddenv.errors import UserError

try:
    import fcntl
except ImportError:
    # Windows: runs can be viewed there, but no engine works.
    fcntl = None  # type: ignore[assignment]

# The mode of a file that only its owner may read.
OWN = 0o600


def _lock_path(run: Path) -> Path:
    return run.with_name(f"{run.name}.lock")


@contextmanager
def engine_lock(run: Path, taken: str = "") -> Iterator[None]:
    """Holds the run's lock. Raises UserError, with the words `taken` if there are any, if another
    engine holds it.
    """
    taken = (
        taken
        or f"{run}: another engine is working on this run; attach to it with 'ddenv open {run}'"
    )
    refused = f"{run}: cannot run an engine here"
    instead = "copy the run to a folder on this machine that you can write to"
    with held(_lock_path(run), taken, refused, instead, mode_beside(run)):
        yield


def mode_beside(run: Path) -> int:
    """The mode of files beside a run: its own, which is the user's alone until the user opens it to
    others.
    """
    try:
        return stat.S_IMODE(run.stat().st_mode) & 0o666
    except OSError:
        return OWN


@contextmanager
def held(lock: Path, taken: str, refused: str, instead: str, mode: int = OWN) -> Iterator[None]:
    """Holds the file `lock`. Raises UserError: `taken` if another process holds it, `refused` if it
    cannot be made or locked.
    """
    if fcntl is None:
        raise UserError(
            f"{refused}: this system has no file locks; use Linux or macOS, or WSL on Windows"
        )
    try:
        handle = os.open(lock, os.O_RDWR | os.O_CREAT, mode)
    except OSError as error:
        raise UserError(f"{refused}: {error.strerror}; {instead}") from None
    try:
        # A viewer that checks for an engine holds the lock for an instant.
        deadline = time.monotonic() + 1.0
        try:
            while not _try(handle, fcntl.LOCK_EX):
                if time.monotonic() > deadline:
                    raise UserError(taken)
                time.sleep(0.02)
        except OSError as error:
            why = f"its folder has no file locks ({error.strerror}), like some network folders"
            raise UserError(f"{refused}: {why}; {instead}") from None
        yield
    finally:
        os.close(handle)


def engine_is_alive(run: Path) -> bool:
    """Whether an engine is working on the run now."""
    if fcntl is None:
        return False
    try:
        handle = os.open(_lock_path(run), os.O_RDONLY)
    except OSError:
        return False
    try:
        return not _try(handle, fcntl.LOCK_SH)
    except OSError:
        # Where there are no locks, no engine works.
        return False
    finally:
        os.close(handle)


def _try(handle: int, kind: int) -> bool:
    try:
        fcntl.flock(handle, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
