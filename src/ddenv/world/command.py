"""The command of an oracle: splits and checks its words, and fills in its placeholders."""

from __future__ import annotations

import os
import re
import shlex
import shutil
from collections.abc import Mapping
from contextlib import suppress
from importlib.util import find_spec
from pathlib import Path

from ddenv.errors import UserError
from ddenv.schemas import nearest
from ddenv.world.access import Unusable, size_of
from ddenv.world.scenario import Scenario

PLACEHOLDERS = ("world", "scenario", "seed", "log")
KEY = "oracle.command"
# Linux reads only this many bytes of a script's first line.
LONGEST_FIRST_LINE = 256
_PLACEHOLDER = re.compile(r"\{(\w+)\}")


def start_folder(scenario: Scenario) -> Path:
    """The folder in which the oracle's command starts, or where its module is searched."""
    own = None if scenario.oracle is None else scenario.oracle.folder
    if own is None:
        return scenario.folder
    return own


def command_words(scenario: Scenario) -> tuple[str, ...]:
    """The words of the oracle's command, the absolute path of its program first, placeholders
    unfilled; () without a command.

    Raises UserError for an unknown placeholder, a missing folder, and a program that is missing or
    not executable; for a simulator in Python, if its module is missing.
    """
    if scenario.oracle is None:
        return ()
    if scenario.oracle.command is None:
        folder = _existing(scenario)
        name = scenario.oracle.program.partition(":")[0]
        top = name.partition(".")[0]
        # Nothing of it is imported.
        if not top or not (
            any(folder.glob(f"{top}.*")) or (folder / top).is_dir() or find_spec(top) is not None
        ):
            hint = nearest(top, [file.stem for file in folder.glob("*.py")])
            raise UserError(
                f"oracle.use: there is no module '{name}' in {folder}, nor installed{hint}"
            )
        return ()
    try:
        words = shlex.split(scenario.oracle.command)
    except ValueError as error:
        raise UserError(f"{KEY}: {str(error).lower()} in: {scenario.oracle.command}") from None
    if not words or not words[0]:
        raise UserError(f"{KEY}: names no program")
    if any("\0" in word for word in words):
        raise UserError(f"{KEY}: has a NUL byte")
    for name in (name for word in words for name in _PLACEHOLDER.findall(word)):
        if name not in PLACEHOLDERS:
            raise UserError(
                f"{KEY}: unknown placeholder {{{name}}}{nearest(name, PLACEHOLDERS)}; "
                "use {world}, {scenario}, {seed} and {log}; shell variables are not available"
            )
    return _program(words[0], _existing(scenario)), *words[1:]


def _existing(scenario: Scenario) -> Path:
    """The oracle's folder. Raises UserError if there is none."""
    folder = start_folder(scenario)
    if not folder.is_dir():
        if scenario.oracle is None or scenario.oracle.folder is None:
            key = "folder"
        else:
            key = "oracle.folder"
        raise UserError(f"{key}: there is no folder {folder} to start the simulator in")
    return folder


def _program(word: str, folder: Path) -> str:
    """The absolute path of the program `word`, relative to `folder` if it has a slash, else from
    PATH. Raises UserError.
    """
    path = folder.absolute() / word
    if "/" not in word:
        if found := shutil.which(word):
            return str(Path(found).absolute())
        beside = "" if _why_no_file(path) else f"; there is one in {folder}: write ./{word}"
        raise UserError(f"{KEY}: no program '{word}' on PATH{beside}")
    if why := _why_no_file(path):
        raise UserError(f"{KEY}: {path}: {why}")
    if not os.access(path, os.X_OK):
        raise UserError(f"{KEY}: {path}: is not executable; use 'chmod +x'")
    # For a script without a usable interpreter the system would only report a missing file.
    head = b"\0"
    with suppress(OSError), path.open("rb") as file:
        head = file.read(LONGEST_FIRST_LINE)
    line = head.partition(b"\n")[0]
    interpreter = (
        os.fsdecode(line[2:].replace(b"\t", b" ").strip(b" ").split(b" ")[0])
        if line.startswith(b"#!")
        else ""
    )
    # Binary programs contain NUL bytes.
    if b"\0" not in head and not os.access(interpreter, os.X_OK):
        hint = "its first line must name one, as '#!/bin/sh' does, with Unix line endings"
        raise UserError(f"{KEY}: {path}:1: there is no interpreter {interpreter!r}; {hint}")
    return str(path)


def _why_no_file(path: Path) -> str:
    """Why `path` cannot be a program file, or ""."""
    try:
        size_of(path)
    except Unusable as error:
        return str(error)
    return ""


def filled(words: tuple[str, ...], values: Mapping[str, str]) -> list[str]:
    """`words` with their placeholders replaced by `values`, except in the program."""
    program, *rest = words
    return [program, *(_PLACEHOLDER.sub(lambda match: values[match[1]], word) for word in rest)]


def has_placeholder(words: tuple[str, ...], name: str) -> bool:
    return any(name in _PLACEHOLDER.findall(word) for word in words[1:])
