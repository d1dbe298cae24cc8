"""One engine works on a run: a lock file beside it, which the system lets go of when the engine dies in any way."""

from __future__ import annotations

import fcntl
import os
import time
from contextlib import contextmanager
from pathlib import Path

from ddenv.errors import UserError


def _lock_path(run: Path) -> Path:
    return run.with_name(f"{run.name}.lock")


@contextmanager
def engine_lock(run: Path):
    """Holds the run's lock. Raises UserError while another engine has it."""
    taken = f"{run}: another engine works on this run; attach to it with 'ddenv open {run}'"
    with held(_lock_path(run), taken, f"{run}: no engine can work here", "copy the run to a folder of yours"):
        yield


@contextmanager
def held(lock: Path, taken: str, refused: str, instead: str):
    """Holds the file `lock`. Raises UserError: `taken` while another process has it, `refused` where it cannot be made."""
    try:
        handle = os.open(lock, os.O_RDWR | os.O_CREAT, 0o644)
    except OSError as error:
        raise UserError(f"{refused}: {error.strerror}; {instead}") from None
    try:
        # A viewer that looks whether an engine is at work holds the lock for an instant.
        deadline = time.monotonic() + 1.0
        while not _try(handle, fcntl.LOCK_EX):
            if time.monotonic() > deadline:
                raise UserError(taken)
            time.sleep(0.02)
        yield
    finally:
        os.close(handle)


def engine_is_alive(run: Path) -> bool:
    """Whether an engine works on the run now."""
    try:
        handle = os.open(_lock_path(run), os.O_RDONLY)
    except OSError:
        return False
    try:
        return not _try(handle, fcntl.LOCK_SH)
    finally:
        os.close(handle)


def _try(handle: int, kind: int) -> bool:
    try:
        fcntl.flock(handle, kind | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True
