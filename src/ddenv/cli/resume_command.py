"""`ddenv resume`: continues a reduction."""

from __future__ import annotations

import click

from ddenv.cli.options import jobs_option, json_option


@click.command("resume")
@click.argument("run")
@jobs_option()
@json_option
def resume_command(run: str, jobs: int, as_json: bool) -> int:
    """Continues RUN (a name or a file) without a screen; no finished test is made again."""
    from ddenv.cli.follow import follow_to_summary
    from ddenv.runfile.fold import fold
    from ddenv.runfile.lock import engine_lock
    from ddenv.runfile.store import RunFile
    from ddenv.runs.folder import find_run
    from ddenv.runs.programs import start_engine

    path = find_run(run)
    with RunFile(path) as file, engine_lock(path):
        # Going back while no engine works ends in a pause, and without a screen nobody can end it.
        if any(command.kind == "go_back" for command in file.commands(fold(file.events()).last_command)):
            file.send("resume")
    # Without a screen there is nobody to ask.
    return follow_to_summary(path, start_engine(path, jobs, accept_mode="automatic"), as_json)[0]
