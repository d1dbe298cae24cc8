"""What this machine remembers from one time to the next, in files of its own."""

from __future__ import annotations

import json
import os
from pathlib import Path
from typing import Any

import platformdirs

from ddenv.errors import UserError
from ddenv.world.access import write_file


def state_file(name: str) -> Path:
    """The path of what is remembered: in `$DDENV_HOME`, or in the user's state folder."""
    home = os.environ.get("DDENV_HOME")
    folder = Path(home) if home else Path(platformdirs.user_state_dir("ddenv", appauthor=False))
    return folder / name


def write_state(name: str, content: object) -> None:
    """Remembers `content` as JSON, for this user alone, if it can be written."""
    place = state_file(name)
    try:
        place.parent.mkdir(parents=True, exist_ok=True)
        write_file(place, json.dumps(content).encode(), 0o600)
    except (OSError, UserError, ValueError):
        return


def read_state(name: str) -> Any:
    """What was remembered; None if it is missing or damaged."""
    try:
        return json.loads(state_file(name).read_bytes())
    except (OSError, ValueError, RecursionError):
        return None
