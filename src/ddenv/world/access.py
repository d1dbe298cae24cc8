"""Reads and writes single files, with errors in one line."""

from __future__ import annotations

import os
import stat
from collections.abc import Mapping
from contextlib import suppress
from functools import partial
from pathlib import Path

from ddenv.errors import UserError
from ddenv.settings import Ignorable
from ddenv.world.tinyxml import Element, NotXml, parse_xml

MAX_BYTES = 100_000_000  # of a file that the user names
# How the names of worlds end: SDF, and Drake's model directives.
SDF_ENDINGS = (".sdf", ".world")
DIRECTIVES_ENDINGS = (".dmd.yaml", ".dmd.yml")
WORLD_ENDINGS = (*SDF_ENDINGS, *DIRECTIVES_ENDINGS)
# What users take for worlds: macros that make one, and robots.
OTHER_ENDINGS = (".xacro", ".urdf")


def is_world(path: Path) -> bool:
    """Whether the name of `path` is that of a world."""
    return path.name.lower().endswith(WORLD_ENDINGS)


def is_read_as_world(path: Path) -> bool:
    """Whether a file is read as a world, by its name: one that cannot be a world as it is says then
    how it becomes one.
    """
    return path.name.lower().endswith((*WORLD_ENDINGS, *OTHER_ENDINGS))


def is_directives(path: Path) -> bool:
    """Whether the name of `path` is that of a file of Drake's model directives."""
    return path.name.lower().endswith(DIRECTIVES_ENDINGS)


def ending_of(world: Path) -> str:
    """How the names of files end that hold a part of `world`."""
    if is_directives(world):
        return DIRECTIVES_ENDINGS[0]
    return SDF_ENDINGS[0]


def check_ending(file: Path, world: Path) -> None:
    """Whether `file` can hold a part of `world`: only its name says how it is read. Raises
    UserError.
    """
    if is_directives(file) != is_directives(world):
        raise UserError(
            f"{file}: what is left of {world.name} needs a name that ends in {ending_of(world)}"
        )


class Missing(Exception):
    """No file was found for a URI; the text says where we looked."""


class Unusable(Exception):
    """A file or URI cannot be used; the text is the reason, in one line."""


class MissingFiles(UserError):
    """Required files cannot be used; `uris` are all of them, with the reason for those that were
    found, else empty.
    """

    def __init__(self, message: str, uris: Mapping[str, str]) -> None:
        super().__init__(message)
        self.uris = uris


class Unsupported(UserError):
    """An element of the kind `tag` is not supported, but can be left out; `name` says in which
    file.
    """

    def __init__(self, message: str, tag: Ignorable, file: Path) -> None:
        super().__init__(message)
        self.tag = tag
        self.name = f"{file}/<{tag}>"


def read(path: Path, limit: int) -> bytes:
    """The bytes of the file `path`. Raises Unusable if it is not a regular file, is unreadable or
    exceeds `limit` bytes.
    """
    size = size_of(path)
    if size > limit:
        raise Unusable(f"{size / 1e6:.0f} MB is too large; the maximum is {limit / 1e6:.0f} MB")
    try:
        with path.open("rb") as file:
            return file.read(size)
    except OSError as error:
        raise Unusable(reason(error)) from None


def xml_root(data: bytes) -> Element:
    """The root element of `data`. Raises Unusable."""
    try:
        return parse_xml(data, Path())
    except NotXml as error:
        raise Unusable(str(error)) from None


def size_of(path: Path) -> int:
    """Size of the file `path` in bytes. Raises Unusable if it is not a regular file."""
    try:
        status = path.stat()
    except OSError as error:
        raise Unusable(reason(error)) from None
    except ValueError:
        raise Unusable("is not a valid file name") from None
    if stat.S_ISDIR(status.st_mode):
        raise Unusable("is a folder, not a file")
    # Reading a pipe or a device might never end.
    if not stat.S_ISREG(status.st_mode):
        raise Unusable("is not a regular file")
    return status.st_size


def not_yaml(where: object, error: Exception) -> UserError:
    """What a YAML parser says of the file `where`, with the line."""
    mark = getattr(error, "problem_mark", None)
    line = "" if mark is None else f":{mark.line + 1}"
    problem = getattr(error, "problem", None) or "not text"
    if isinstance(error, RecursionError):
        problem = "nested too deeply"
    return UserError(f"{where}{line}: not valid YAML: {problem}")


def is_folder(path: Path) -> bool:
    """Whether `path` is an accessible folder; a name that no file can have is none."""
    return os.path.isdir(path)  # noqa: PTH112  # `Path.is_dir` may raise


def folders_of(folder: Path) -> list[str]:
    """The sorted names of the folders in `folder`; none if it is not accessible."""
    try:
        with os.scandir(folder) as entries:
            return sorted(entry.name for entry in entries if entry.is_dir())
    except (OSError, ValueError):
        return []


def is_file(path: Path) -> bool:
    """Whether `path` is an accessible file. Any text is taken for a path: one that is too long, or
    holds a NUL byte, is none.
    """
    return os.path.isfile(path)  # noqa: PTH113  # `Path.is_file` may raise


def without_tilde(name: str) -> Path:
    """`name` with a leading `~` expanded, if the home folder is known."""
    return Path(os.path.expanduser(name))  # noqa: PTH111  # `Path.expanduser` may raise


def reason(error: OSError) -> str:
    """Why a file cannot be read."""
    if isinstance(error, FileNotFoundError):
        return "no such file"
    return f"cannot be read: {error.strerror or error}"


def read_bytes(path: Path) -> bytes:
    """The content of a file. Raises UserError if it is missing, unreadable or larger than
    `MAX_BYTES`.
    """
    try:
        return read(path, MAX_BYTES)
    except Unusable as error:
        raise UserError(f"{path}: {error}") from None


def resolved(path: Path) -> Path:
    """The whole path of a file. Raises UserError for one that is not UTF-8: run files, which are
    JSON, cannot hold it.
    """
    whole = path.resolve()
    try:
        str(whole).encode()
    except UnicodeEncodeError:
        raise UserError(
            f"{whole}: this path is not UTF-8 text, so that no run can name it; rename it"
        ) from None
    return whole


def write_file(path: Path, content: bytes, mode: int = 0o666) -> None:
    """Writes `content` atomically: to a temporary file beside `path`, which is then renamed. Raises
    UserError.

    `mode` are the file's permissions, from which the user's mask takes away.
    """
    temporary = path.parent / f".{path.name}.{os.urandom(4).hex()}"
    try:
        with open(temporary, "xb", opener=partial(os.open, mode=mode)) as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        with suppress(OSError):
            temporary.unlink()
        raise UserError(f"{path}: cannot be written: {error.strerror}") from None
