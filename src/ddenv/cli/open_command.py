"""`ddenv open`: the workbench on a run."""

from __future__ import annotations

import sys

import click


@click.command("open")
@click.argument("run")
@click.option("--watch", is_flag=True, help="Only watch: changes and writes nothing, not even beside RUN.")
@click.option("--lines", is_flag=True, help="Plain lines that are never drawn again, for screen readers: type help.")
def open_command(run: str, watch: bool, lines: bool) -> int:
    """Attaches the workbench to RUN (a name or a file)."""
    from ddenv.runs.folder import find_run

    path = find_run(run)
    if not lines:
        from ddenv.workbench.launch import run_workbench

        return run_workbench(path, watch=watch)
    from ddenv.workbench.lines.line_mode import follow_in_lines

    try:
        follow_in_lines(path, watch, sys.stdin, sys.stdout)
    except KeyboardInterrupt:
        # As quit: the engine goes on.
        return 130
    return 0
