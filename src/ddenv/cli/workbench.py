"""Commands that open the workbench, here or in a browser: `ddenv open` and `serve`."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ddenv.cli.options import (
    Whole,
    fetch_option,
    given_reading,
    reading_options,
    runs,
    runs_and_scenarios,
)
from ddenv.errors import UserError
from ddenv.runs.folder import find_run, named

if TYPE_CHECKING:
    from ddenv.runs.experiment import Fetch

PORT = 8000


@click.command("open")
@click.argument("run", metavar="RUN_OR_FILE", type=click.Path(), shell_complete=runs_and_scenarios)
@reading_options
@fetch_option
@click.option(
    "--watch", is_flag=True, help="Only watch: changes and writes nothing, not even beside RUN."
)
@click.option(
    "--lines",
    is_flag=True,
    help="Plain lines that are never redrawn, for screen readers: type help.",
)
@click.pass_obj
def open_command(
    before: Mapping[str, Any], /, run: str, watch: bool, lines: bool, **reading: Any
) -> int:
    """Attaches the workbench to a run (its name or file), or opens it on a scenario or an SDF
    world.

    'ddenv RUN_OR_FILE' does the same; options for reading worlds may also stand before RUN_OR_FILE.
    """
    from ddenv.runs.experiment import reading_of, world_of
    from ddenv.workbench.launch import run_workbench
    from ddenv.world.access import is_folder

    for name, value in before.items():
        reading[name] = (
            value + reading[name] if isinstance(value, tuple) else reading[name] or value
        )
    kind, path = named(run) or ("run", find_run(run))
    if kind == "run" and path.is_file():
        if any(reading.values()):
            raise UserError("options for reading worlds: a run keeps its own")
        if not lines:
            return run_workbench(path, watch=watch)
        from ddenv.workbench.line_mode import LineMode, typed_lines

        # Interrupted as after quit, the engine goes on.
        LineMode(path, watch, sys.stdout).follow(typed_lines(sys.stdin))
        return 0
    if is_folder(Path(run)):
        raise UserError(f"{run}: is a folder; expected a run, a scenario or a world")
    if kind == "run":
        raise UserError(f"{path}: no such run file; 'ddenv runs' lists the runs")
    if not path.is_file():
        raise UserError(f"{run}: no such file")
    if watch or lines:
        raise UserError(f"{'--watch' if watch else '--lines'}: only for runs")
    fetch: Fetch | None = reading.pop("fetch")
    given = given_reading(reading)
    if fetch is not None:
        from ddenv.world.sdf.read import parse_world

        world, own = world_of(path)
        fetch(world, reading_of(own, **given), parse_world)
    return run_workbench(None, reading=given, file=path.absolute())


def _refuse_host(_: Any, __: Any, value: str | None) -> None:
    if value is not None:
        raise UserError(
            "--host: the workbench is only served on 127.0.0.1, since anyone who can open it "
            "acts as you; "
            "from another machine use ssh -L"
        )


@click.command("serve")
@click.argument("run", required=False, shell_complete=runs)
@click.option(
    "--port", type=Whole(1, 65535), default=PORT, show_default=True, help="Port on 127.0.0.1."
)
@click.option(
    "--font-size",
    type=Whole(6, 72),
    default=16,
    show_default=True,
    help="Text size in pixels; 28 for a projector.",
)
@click.option("--host", hidden=True, expose_value=False, callback=_refuse_host)
def serve_command(run: str | None, port: int, font_size: int) -> int:
    """Serves the workbench to browsers on this machine; with RUN (a name or a file) attached to
    it.
    """
    from ddenv.workbench.terminal.served import serve

    serve(port, run, font_size)
    return 0
