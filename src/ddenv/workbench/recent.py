"""The runs in the runs folder, newest first, each with the words for a list."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from ddenv.errors import UserError
from ddenv.runfile.fold import fold
from ddenv.runfile.lock import engine_is_alive
from ddenv.runfile.state import RunState
from ddenv.runfile.store import RunFile
from ddenv.workbench.wording import STATUS

# Older runs are opened from the command line.
SHOWN = 40


@dataclass(frozen=True, slots=True)
class Recent:
    """A run in the list: `sign` and `words` tell how it stands, `trouble` why it cannot be opened."""

    path: Path
    sign: str
    words: str
    trouble: str = ""


def recent_runs(folder: Path) -> list[Recent]:
    """The newest runs in `folder`; damaged ones are listed with what is wrong."""
    try:
        paths = sorted(folder.glob("*.ddenv"), key=lambda path: -path.stat().st_mtime)
    except OSError:
        return []
    return [_recent(path) for path in paths[:SHOWN]]


def _recent(path: Path) -> Recent:
    try:
        with RunFile(path) as run:
            state = fold(run.events())
    except UserError as error:
        return Recent(path, "✗", "cannot be read", str(error))
    status = state.status if state.ended or state.status == "created" or engine_is_alive(path) else "lost"
    sign, word = STATUS.get(status, ("·", status))
    return Recent(path, sign, f"{_models(state)}{word}")


def _models(state: RunState) -> str:
    total, kept = len(state.elements), len(state.environment)
    return f"{kept}/{total} " if total else ""
