"""`ddenv resume`: continues a reduction."""

from __future__ import annotations

import click

from ddenv.cli.completing import runs
from ddenv.cli.options import announce, cluster_option, jobs_option, json_option, trust_option
from ddenv.errors import UserError


@click.command("resume")
@click.argument("run", shell_complete=runs)
@jobs_option()
@cluster_option()
@click.option("--mixed", is_flag=True, help="Go on even if other versions or another processor give other results.")
@click.option("--anyway", is_flag=True, help="Go on even if the last engines died again and again.")
@click.option("--again", is_flag=True, help="Make all tests again, in a new run of the same scenario.")
@trust_option
@json_option
def resume_command(
    run: str, jobs: int, cluster: str | None, mixed: bool, anyway: bool, again: bool, trust: bool, as_json: bool
) -> int:
    """Continues RUN (a name or a file) without a screen; no finished test is made again.

    If Drake, Python or the processor is another one than before, the first run of the whole world is made again and compared.
    """
    from ddenv.cli.follow import follow_to_summary
    from ddenv.cli.trusting import allow_run
    from ddenv.runfile.fold import fold
    from ddenv.runfile.lock import engine_lock
    from ddenv.runfile.store import RunFile
    from ddenv.runs.creation import create_like
    from ddenv.runs.folder import find_run, run_path
    from ddenv.runs.programs import start_engine

    path = find_run(run)
    if mixed and again:
        raise UserError("--mixed and --again: give one of them")
    where = {"cluster": cluster} if cluster else {}
    with RunFile(path) as file:
        scenario = allow_run(file, trust, cluster)
        if not again:
            with engine_lock(path):
                # Going back while no engine works ends in a pause, and without a screen nobody can end it.
                if any(command.kind == "go_back" for command in file.commands(fold(file.events()).last_command)):
                    file.send("resume")
    if again:
        new = run_path(scenario.name, None, path.parent)
        create_like(path, scenario, new)
        announce(f"makes the tests of {path} again in {new}")
        return follow_to_summary(new, start_engine(new, jobs, **where), as_json)[0]
    # Without a screen there is nobody to ask.
    bits = "mixed" if mixed else "same"
    go_on = "yes" if anyway else "no"
    engine = start_engine(path, jobs, accept_mode="automatic", bits=bits, anyway=go_on, **where)
    return follow_to_summary(path, engine, as_json)[0]
