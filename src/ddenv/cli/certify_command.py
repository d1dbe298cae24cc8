"""`ddenv certify`: more evidence for the result of a run."""

from __future__ import annotations

import click

from ddenv.cli.completing import runs
from ddenv.cli.options import cluster_option, jobs_option, json_option, trust_option, whole
from ddenv.errors import UserError


@click.command("certify")
@click.argument("run", shell_complete=runs)
@click.option(
    "--runs",
    type=whole(1),
    metavar="N",
    help="Run what is left at least so often; as often as the baseline's whole world if not given.",
)
@jobs_option()
@cluster_option()
@trust_option
@json_option
def certify_command(run: str, runs: int | None, jobs: int, cluster: str | None, trust: bool, as_json: bool) -> int:
    """Makes one more certificate of what RUN (a name or a file) has left, with fresh seeds; it changes nothing else."""
    from ddenv.cli.follow import follow_to_summary
    from ddenv.cli.trusting import idle_run
    from ddenv.runfile.run_settings import settings
    from ddenv.runs.programs import start_engine

    path, state = idle_run(run, trust, cluster)
    if state.baseline is None:
        raise UserError(
            f"{path}: f is not known yet, so there is nothing to certify; run it first: ddenv resume {path}"
        )
    if state.status != "finished" and not (state.confirming and state.ended):
        raise UserError(f"{path}: its search is not over; let it end first: ddenv resume {path}")
    where = {"cluster": cluster} if cluster else {}
    at_least = runs or settings(state).baseline_runs
    return follow_to_summary(path, start_engine(path, jobs, certify=at_least, **where), as_json)[0]
