"""`ddenv open`: the workbench on a run, or on a scenario or world that is not started yet."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from ddenv.cli.completing import runs_and_scenarios
from ddenv.cli.options import given_reading, reading_options
from ddenv.errors import UserError


@click.command("open")
@click.argument("run", metavar="RUN_OR_FILE", type=click.Path(), shell_complete=runs_and_scenarios)
@reading_options
@click.option("--watch", is_flag=True, help="Only watch: changes and writes nothing, not even beside RUN.")
@click.option("--lines", is_flag=True, help="Plain lines that are never drawn again, for screen readers: type help.")
def open_command(run: str, watch: bool, lines: bool, **reading: Any) -> int:
    """Attaches the workbench to a run (its name or file), or opens it on a scenario or an SDF world.

    'ddenv RUN_OR_FILE' does the same.
    """
    from ddenv.runs.folder import find_run
    from ddenv.runs.subject import named
    from ddenv.world.access import is_folder

    kind, path = named(run) or ("run", find_run(run))
    if kind == "run" and path.is_file():
        if any(reading.values()):
            raise UserError("options for reading worlds: a run keeps its own")
        return _follow(path, watch) if lines else _show(path, watch=watch)
    if is_folder(Path(run)):
        raise UserError(f"{run}: is a folder; expected a run, a scenario or a world")
    if kind == "run":
        raise UserError(f"{path}: no such run file; 'ddenv runs' lists the runs")
    if not path.is_file():
        raise UserError(f"{run}: no such file")
    if watch or lines:
        raise UserError(f"{'--watch' if watch else '--lines'}: only for runs")
    return _show(None, reading=given_reading(reading), file=path.absolute())


def _show(run: Path | None, **options: Any) -> int:
    from ddenv.workbench.launch import run_workbench

    return run_workbench(run, **options)


def _follow(run: Path, watch: bool) -> int:
    from ddenv.workbench.lines.line_mode import follow_in_lines

    try:
        follow_in_lines(run, watch, sys.stdin, sys.stdout)
    except KeyboardInterrupt:
        # As quit: the engine goes on.
        return 130
    return 0
