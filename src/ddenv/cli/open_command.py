"""`ddenv open`: the workbench on a run."""

from __future__ import annotations

import click


@click.command("open")
@click.argument("run")
@click.option("--watch", is_flag=True, help="Only watch: changes and writes nothing, not even beside RUN.")
def open_command(run: str, watch: bool) -> int:
    """Attaches the workbench to RUN (a name or a file)."""
    from ddenv.runs.folder import find_run
    from ddenv.workbench.launch import run_workbench

    return run_workbench(find_run(run), watch=watch)
