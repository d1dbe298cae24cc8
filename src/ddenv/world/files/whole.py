"""Reads and writes whole files that a user names, and complains in one line."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from ddenv.errors import UserError

MAX_BYTES = 100_000_000


def read_bytes(path: Path) -> bytes:
    """The whole file. Raises UserError for a file that is missing, unreadable or far too large."""
    try:
        if path.is_dir():
            raise UserError(f"{path}: is a folder; expected a file")
        if path.exists() and not path.is_file():
            raise UserError(f"{path}: is no plain file")
        size = path.stat().st_size
        if size > MAX_BYTES:
            raise UserError(f"{path}: {size / 1e6:.0f} MB is too large; at most {MAX_BYTES / 1e6:.0f} MB are read")
        return path.read_bytes()
    except FileNotFoundError:
        raise UserError(f"{path}: no such file") from None
    except ValueError:
        raise UserError(f"{path}: cannot be a file's name") from None
    except OSError as error:
        raise UserError(f"{path}: cannot be read: {error.strerror}") from None


def write_file(path: Path, content: bytes) -> None:
    """Writes all of `content` or nothing: a temporary file beside `path`, then a rename. Raises UserError."""
    try:
        handle, name = tempfile.mkstemp(prefix=f".{path.name}.", dir=path.parent)
    except OSError as error:
        raise UserError(f"{path}: cannot be written: {error.strerror}") from None
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        Path(name).chmod(0o666 & ~_umask())
        Path(name).replace(path)
    except OSError as error:
        Path(name).unlink(missing_ok=True)
        raise UserError(f"{path}: cannot be written: {error.strerror}") from None


def _umask() -> int:
    mask = os.umask(0)
    os.umask(mask)
    return mask
