"""Names and paths of run files, and what a name on the command line stands for."""

from __future__ import annotations

import os
import shlex
from contextlib import suppress
from itertools import count
from pathlib import Path
from typing import Literal
from urllib.parse import unquote, urlsplit

import platformdirs

from ddenv.errors import UserError
from ddenv.text import plain
from ddenv.world.access import WORLD_ENDINGS, is_read_as_world, is_world

SUFFIX = ".ddenv"
SCENARIO_FILES = (".yaml", ".yml")
# The run in the folder of a bundle.
BUNDLED_RUN = f"run{SUFFIX}"
# Maximum length of a run's name, bytes: leaves room for a number and for the suffixes of the files
# beside it.
LONGEST_STEM = 180


def runs_folder() -> Path:
    """The default folder of runs: `$DDENV_HOME/runs`, or in the user's data folder."""
    home = os.environ.get("DDENV_HOME")
    return (
        Path(home) if home else Path(platformdirs.user_data_dir("ddenv", appauthor=False))
    ) / "runs"


def find_run(name: str) -> Path:
    """The run file called `name`: a path, a name in the runs folder, or the folder of a bundle."""
    path = Path(name)
    if path.is_file():
        return path
    stored = path if len(path.parts) > 1 else runs_folder() / f"{name.removesuffix(SUFFIX)}{SUFFIX}"
    bundled = path / BUNDLED_RUN
    if not stored.is_file() and bundled.is_file():
        return bundled
    return stored


def named(name: str) -> tuple[Literal["run", "scenario", "world"], Path] | None:
    """What `name` stands for, with its file, which need not exist if its suffix says what it is;
    None for any other name.

    A run comes before a bundled scenario, and every file before both.
    """
    run = find_run(name)
    if (
        run.is_file() and not is_read_as_world(run) and run.suffix.lower() not in SCENARIO_FILES
    ) or name.endswith(SUFFIX):
        return "run", run
    return named_file(name)


def named_file(name: str) -> tuple[Literal["scenario", "world"], Path] | None:
    """The same where no run is meant."""
    from ddenv.world.load import SCENARIOS, bundled_names

    path = Path(name)
    if is_read_as_world(path):
        return "world", path
    if path.suffix.lower() in SCENARIO_FILES:
        return "scenario", path
    if name in bundled_names() and not path.exists():
        return "scenario", SCENARIOS / f"{name}.yaml"
    return None


def attach_name(run: Path) -> str:
    """A run's name if it is in the runs folder, else its path, quoted for a shell."""
    return shlex.quote(plain(run.stem if find_run(run.stem) == run else run))


def dropped_run(text: str) -> Path | None:
    """The run file whose name a terminal pastes when the file is dropped on it: plain, quoted,
    escaped, or as a file:// URL.
    """
    try:
        words = shlex.split(text.strip())
    except ValueError:
        words = []
    for word in (text.strip(), *words[:1]):
        path = Path(unquote(urlsplit(word).path) if word.startswith("file://") else word)
        # Pasted text can be of any length and kind.
        with suppress(OSError, ValueError):
            if path.suffix == SUFFIX and path.is_file():
                return path
    return None


def free_run_path(scenario_name: str, folder: Path | None = None) -> Path:
    """The first free name-1, name-2, ... in a folder, by default the runs folder."""
    folder = folder or runs_folder()
    stem = "".join(char if char.isalnum() or char in "-_" else "-" for char in scenario_name)
    # 80 letters of four bytes each are too long for file systems.
    stem = stem.encode()[:LONGEST_STEM].decode(errors="ignore")
    paths = (folder / f"{stem}-{number}{SUFFIX}" for number in count(1))
    return next(path for path in paths if not path.exists())


def run_path(scenario_name: str, name: str | None, output: Path | None) -> Path:
    """Where a new run is written: `output` (a .ddenv file or a folder), or in the runs folder.
    Raises UserError.
    """
    if name is not None and (
        not name.strip() or any(char in name for char in "/\\\0") or name.startswith(".")
    ):
        raise UserError(f"--name: '{name}' is not a valid file name; use letters, digits, - and _")
    if output is not None and is_world(output):
        if not output.parent.is_dir():
            raise UserError(f"--output: there is no folder {output.parent}")
        output = None
    if output is not None and not output.is_dir():
        if output.suffix != SUFFIX:
            raise UserError(
                f"--output: '{output}' is neither a folder nor a "
                f"{', '.join((SUFFIX, *WORLD_ENDINGS))} file"
            )
        return output
    folder = output or runs_folder()
    if name is None:
        return free_run_path(scenario_name, folder)
    return folder / f"{name.removesuffix(SUFFIX)}{SUFFIX}"
