"""`ddenv isolate`: the nearest world that passes."""

from __future__ import annotations

import json
import sys
from dataclasses import asdict
from pathlib import Path

import click

from ddenv.cli.completing import runs
from ddenv.cli.options import cluster_option, jobs_option, json_option, trust_option, whole
from ddenv.errors import UserError
from ddenv.text import printable


@click.command("isolate")
@click.argument("run", shell_complete=runs)
@click.option(
    "--runs",
    type=whole(1),
    metavar="N",
    help="Run the world that passes at least so often with fresh seeds; at least 20 times if not given.",
)
@click.option("--again", is_flag=True, help="Search again, although the nearest world that passes is known.")
@click.option("--give-up", is_flag=True, help="End a search that was interrupted; the run is as it was before.")
@jobs_option()
@cluster_option()
@trust_option
@json_option
def isolate_command(
    run: str, runs: int | None, again: bool, give_up: bool, jobs: int, cluster: str | None, trust: bool, as_json: bool
) -> int:
    """Finds the nearest world that passes: as few models removed from the whole world of RUN (a name or a file) as it takes for the
    robot to reach its goal. It changes nothing else.
    """
    from ddenv.cli.follow import Interrupted, follow
    from ddenv.cli.trusting import idle_run
    from ddenv.guiding.course import Isolate
    from ddenv.guiding.situation import Situation
    from ddenv.runs.programs import start_engine

    path, state = idle_run(run, trust, cluster)
    if give_up:
        if state.isolating is None:
            raise UserError(f"{path}: no search for the nearest world that passes is open, so there is none to give up")
        follow(path, start_engine(path, 1, give_up="yes"), sys.stderr if as_json else sys.stdout)
        return 0
    if why := Isolate(again=True).refusal(Situation(state, "absent")):
        raise UserError(f"{path}: {why}: ddenv resume {path}")
    if state.isolated is None or state.isolating is not None or again or runs is not None:
        where = {"cluster": cluster} if cluster else {}
        try:
            follow(path, start_engine(path, jobs, isolate=runs or 0, **where), sys.stderr if as_json else sys.stdout)
        except Interrupted as interrupted:
            if interrupted.state.isolating is not None or interrupted.state.isolated is None:
                print(
                    printable(f"interrupted; continue with: ddenv isolate {path}, or end it with --give-up"),
                    file=sys.stderr,
                )
                return 130
    return _print(path, as_json)


def _print(path: Path, as_json: bool) -> int:
    """Prints what was found; returns the exit code."""
    from ddenv.cli.wrapping import terminal_columns, wrapped
    from ddenv.runfile.fold import fold
    from ddenv.runfile.store import RunFile
    from ddenv.runs.nearest import nearest

    with RunFile(path) as file:
        state = fold(file.events())
        found = nearest(file, state)
    if found is None:
        # The engine was stopped from elsewhere.
        raise UserError(f"{path}: {state.reason}")
    columns = terminal_columns()
    print(
        json.dumps({"nearest": asdict(found)}) if as_json else "\n".join(wrapped(printable(found.sentences), columns))
    )
    return 0 if found.gone else 1
