"""The scenarios and worlds that were opened before, newest first, kept between sessions."""

from __future__ import annotations

import json
import os
from pathlib import Path

from ddenv.errors import UserError

# More would hide what is looked for.
KEPT = 12


def recent_file() -> Path:
    """Where the list is kept: in `$DDENV_HOME`, or in the user's state folder."""
    import platformdirs

    home = os.environ.get("DDENV_HOME")
    folder = Path(home) if home else Path(platformdirs.user_state_dir("ddenv", appauthor=False))
    return folder / "recent.json"


def recent_files() -> list[Path]:
    """The files that still are there; none where the list is missing or damaged."""
    return [path for path in _listed() if is_file(path)]


def remember(path: Path) -> None:
    """Puts a file at the head of the list. Where nothing can be written, nothing is remembered."""
    from ddenv.world.files.whole import write_file

    path = path.absolute()
    names = [path, *(each for each in _listed() if each != path)][:KEPT]
    place = recent_file()
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        write_file(place, json.dumps([str(each) for each in names]).encode())
    except (OSError, UserError, ValueError):
        return


def _listed() -> list[Path]:
    try:
        names = json.loads(recent_file().read_bytes())
    except (OSError, ValueError, RecursionError):
        return []
    if not isinstance(names, list):
        return []
    return [Path(name) for name in names if isinstance(name, str) and name][:KEPT]


def is_file(path: Path) -> bool:
    """Whether there is such a file, and it can be looked at."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False
