"""`ddenv reproduce`: whether what a run has left still fails as it did, with an exit code for `git bisect run`."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import click

from ddenv.cli.completing import runs
from ddenv.cli.options import jobs_option, json_option, trust_option

# As `git bisect run` reads them.
FAILS, PASSES, CANNOT_SAY = 1, 0, 125


@click.command("reproduce")
@click.argument("run", shell_complete=runs)
@click.option("--most", type=click.IntRange(1, 10_000), default=60, show_default=True, help="Runs at most.")
@click.option(
    "--folder",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Where the controller or the simulator of your own lies; the folder of the run's scenario if not given.",
)
@jobs_option("Runs")
@trust_option
@json_option
def reproduce_command(run: str, most: int, folder: Path | None, jobs: int, trust: bool, as_json: bool) -> int:
    """Runs what RUN (a name or a file) has left until it is known whether it still fails at the rate of its certificate.

    Exit codes are those of git bisect run: 1 it fails at that rate, 0 it does not (at less than half of it), 125 it cannot be
    said: the runs do not decide, or something is wrong.
    """
    from ddenv.cli.test_summary import line
    from ddenv.cli.trusting import allow
    from ddenv.engine.single_test import expected, reproduce, subject_in
    from ddenv.runs.folder import find_run
    from ddenv.text import percent

    path = find_run(run)
    subject = subject_in(path, folder)
    claim = expected(subject, path)
    allow(subject.scenario, path, trust)
    for result, so_far in reproduce(subject, claim.low, most, jobs):
        found = so_far
        if not as_json:
            print(line(result), flush=True)
    if as_json:
        print(json.dumps(asdict(found) | {"expected": {"low": claim.low, "high": claim.high}}))
    else:
        print(f"{found}; {percent(claim.low)} to {percent(claim.high)} expected")
    return {True: FAILS, False: PASSES, None: CANNOT_SAY}[found.fails]
