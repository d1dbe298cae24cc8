"""Checks of the installation, the terminal, the machine and the folder of runs."""

from __future__ import annotations

import importlib.util
import math
import os
import platform
import shutil
import sqlite3
import sys
import tempfile
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from ddenv import __version__
from ddenv.doctor import Finding
from ddenv.runs import processor
from ddenv.runs.folder import SUFFIX, runs_folder
from ddenv.text import count

# By the names that packages are installed as, with the module that shows that they are there.
NEEDED = {
    "drake": "pydrake",
    "textual": "textual",
    "numpy": "numpy",
    "scipy": "scipy",
    "scikit-learn": "sklearn",
}
SMALLEST = (80, 24)
# Less free space or memory than this is worth a line, bytes.
LITTLE_SPACE = 500_000_000
LITTLE_MEMORY = 1_500_000_000


def installation() -> Iterator[Finding]:
    yield Finding(
        group="installation", what="ddenv", says=f"{__version__}, {Path(__file__).parents[1]}"
    )
    yield Finding(
        group="installation", what="Python", says=f"{platform.python_version()}, {sys.executable}"
    )
    for name, module in NEEDED.items():
        if importlib.util.find_spec(module) is not None:
            yield Finding(group="installation", what=name, says=_version(name))
        elif name == "drake" and sys.platform == "win32":
            yield Finding(
                group="installation",
                what=name,
                says="not for Windows: runs can be viewed here, not made",
                state="note",
            )
        else:
            yield Finding(
                group="installation",
                what=name,
                says="not installed",
                state="wrong",
                advice=f"pip install {name}",
            )
    yield Finding(group="installation", what="SQLite", says=sqlite3.sqlite_version)


def _version(name: str) -> str:
    try:
        return version(name)
    except PackageNotFoundError:
        return "of unknown version"


def terminal() -> Iterator[Finding]:
    if not (sys.stdin.isatty() and sys.stdout.isatty()):
        yield Finding(
            group="terminal",
            what="terminal",
            says="none: input or output is not a terminal; 'ddenv run' works without one",
        )
    else:
        columns, lines = shutil.get_terminal_size()
        small = columns < SMALLEST[0] or lines < SMALLEST[1]
        if small:
            advice = f"the workbench is designed for {SMALLEST[0]} by {SMALLEST[1]} or more"
        else:
            advice = ""
        yield Finding(
            group="terminal",
            what="size",
            says=f"{columns} columns, {lines} lines",
            state="note" if small else "ok",
            advice=advice,
        )


def machine() -> Iterator[Finding]:
    cores = processor.usable_cores()
    all_cores = os.cpu_count() or 1
    yield Finding(
        group="machine",
        what="cores",
        says=f"{cores} of {all_cores} may be used; {processor.name()}",
    )
    yield _memory()
    yield _space("temporary files", Path(tempfile.gettempdir()), "machine")


def _memory() -> Finding:
    usable = processor.usable_memory()
    free = processor.free_memory()
    if not math.isfinite(usable + free):
        return Finding(group="machine", what="memory", says="unknown")
    says = f"{usable / 1e9:.1f} GB may be used, {free / 1e9:.1f} GB are free"
    if free >= LITTLE_MEMORY:
        return Finding(group="machine", what="memory", says=says)
    return Finding(
        group="machine",
        what="memory",
        says=says,
        state="note",
        advice="run fewer tests at the same time: --jobs 1",
    )


def runs() -> Iterator[Finding]:
    folder = runs_folder()
    yield Finding(
        group="runs",
        what="folder",
        says=f"{folder}, {count(len(list(folder.glob(f'*{SUFFIX}'))), 'run')}",
    )
    nearest = next(each for each in (folder, *folder.parents) if each.exists())
    yield _space("disk space", nearest, "runs")


def _space(what: str, folder: Path, group: str) -> Finding:
    """Whether files can be made in a folder, and how much disk space is free."""
    free = shutil.disk_usage(folder).free
    says = f"{free / 1e9:.1f} GB free in {folder}"
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(b"ddenv")
    except OSError as error:
        says = f"{folder} cannot be written: {error.strerror}"
        advice = "set another one in DDENV_HOME or TMPDIR"
        return Finding(group=group, what=what, says=says, state="wrong", advice=advice)
    if free < LITTLE_SPACE:
        return Finding(
            group=group,
            what=what,
            says=says,
            state="note",
            advice="a run needs up to a few hundred MB",
        )
    return Finding(group=group, what=what, says=says)
