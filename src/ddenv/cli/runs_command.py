"""`ddenv runs`: the list of runs."""

from __future__ import annotations

from pathlib import Path

import click

from ddenv.errors import UserError
from ddenv.text import printable


@click.command("runs")
def runs_command() -> int:
    """Lists the runs."""
    from ddenv.runs.folder import runs_folder

    lines = run_lines(runs_folder())
    print("\n".join(lines) if lines else f"no runs yet in {runs_folder()}; 'ddenv run ditch' makes one")
    return 0


def run_lines(folder: Path) -> list[str]:
    """One line a run, newest first: name, status, models left, tests. A damaged file says so in its line."""
    paths = sorted((path for path in folder.glob("*.ddenv") if path.is_file()), key=_changed, reverse=True)
    width = max((len(path.stem) for path in paths), default=0)
    return [printable(f"{path.stem:<{width}}  {_line(path)}") for path in paths]


def _changed(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except FileNotFoundError:
        return 0.0


def _line(path: Path) -> str:
    from ddenv.runfile.fold import fold
    from ddenv.runfile.lock import engine_is_alive
    from ddenv.runfile.store import RunFile

    try:
        with RunFile(path) as file:
            state = fold(file.events())
    except UserError as error:
        return str(error)
    status = state.status
    if not state.ended and status != "created" and not engine_is_alive(path):
        status = "engine not running"
    elif status == "finished" and state.minimal:
        status = "minimal"
    size = f"{len(state.environment)} of {len(state.elements)} models"
    return f"{status:<18}  {size:<20}  {state.tests_done} tests"
