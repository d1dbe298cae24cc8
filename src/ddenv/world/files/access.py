"""Reading the files that an SDF file names, with the two ways in which that fails."""

from __future__ import annotations

import stat
from pathlib import Path


class Missing(Exception):
    """No file for a URI anywhere; the text says where was looked."""


class Unusable(Exception):
    """A file, or a URI, that cannot be used; the text is the reason, in one line."""


def read(path: Path, limit: int) -> bytes:
    """The bytes of the file `path`. Raises Unusable if it is no plain file, cannot be read, or has over `limit` bytes."""
    size = size_of(path)
    if size > limit:
        raise Unusable(f"has {size / 1e6:.0f} MB; the limit is {limit / 1e6:.0f} MB")
    try:
        with path.open("rb") as file:
            return file.read(limit)
    except OSError as error:
        raise Unusable(reason(error)) from None


def size_of(path: Path) -> int:
    """Size of the file `path` in bytes. Raises Unusable if it is no plain file."""
    try:
        status = path.stat()
    except OSError as error:
        raise Unusable(reason(error)) from None
    except ValueError:
        raise Unusable("cannot be the name of a file") from None
    if stat.S_ISDIR(status.st_mode):
        raise Unusable("is a folder, not a file")
    # A pipe or a device could be waited on, or read, for ever.
    if not stat.S_ISREG(status.st_mode):
        raise Unusable("is not a plain file")
    return status.st_size


def is_folder(path: Path) -> bool:
    """Whether `path` is a folder that can be seen."""
    try:
        return stat.S_ISDIR(path.stat().st_mode)
    except (OSError, ValueError):
        return False


def without_tilde(name: str) -> Path:
    """`name` with a leading `~` made the home folder; as it is where nobody knows that folder."""
    try:
        return Path(name).expanduser()
    except RuntimeError:
        return Path(name)


def reason(error: OSError) -> str:
    return f"cannot be read: {error.strerror or error}"
