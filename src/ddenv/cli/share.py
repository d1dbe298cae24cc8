"""Commands that take a run to others: `ddenv report` and `export` write it to files, `reproduce`
asks whether it still fails.
"""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import click

from ddenv.cli import options
from ddenv.cli.run import announce_needs
from ddenv.cli.terminal import CANNOT_SAY, announce, asking, say_written
from ddenv.errors import UserError
from ddenv.runs.folder import find_run
from ddenv.text import percent

# How `git bisect run` reads exit codes.
FAILS = 1
PASSES = 0


@click.command("report")
@options.run_argument
@click.option(
    "-o",
    "--output",
    "file",
    type=Path,
    metavar="FILE",
    help="A .html page, or a .md file with its pictures beside it; required.",
)
@click.option("--force", is_flag=True, help="Replace files that exist.")
def report_command(run: str, file: Path | None, force: bool) -> int:
    """Writes a report on RUN: one page to read, print or mail."""
    from ddenv.report.report import write_report
    from ddenv.runfile.store import RunFile

    path = find_run(run)
    if file is None:
        # A run that is not there needs no file either.
        RunFile(path).close()
        raise UserError(f"give the file to write, such as -o {path.stem}.html")
    say_written(write_report(path, file, force))
    return 0


@click.command("export")
@options.run_argument
@click.option(
    "--sdf",
    "--output",
    "sdf",
    type=Path,
    help="Write the environment as a world: SDF, or directives (.dmd.yaml) if the world is.",
)
@click.option(
    "--passes",
    is_flag=True,
    help=(
        "With --sdf: write the nearest world that passes, instead of what is left ('ddenv "
        "isolate RUN' finds it)."
    ),
)
@click.option(
    "--margin",
    multiple=True,
    metavar="NUMBER",
    help="With --sdf: change this number, such as green_patch_01.friction, to the nearest value "
    "with which the robot reaches its "
    "goal ('ddenv margins RUN' finds it), or to that of NUMBER=VALUE; may be repeated.",
)
@click.option(
    "--scenario",
    type=Path,
    help="Write a scenario (YAML) that runs the robot in that world; needs --sdf.",
)
@click.option(
    "--bundle",
    type=Path,
    metavar="FOLDER_OR_ZIP",
    help=(
        "Write everything needed to reproduce the failure on another machine: run, world, "
        "scenario, report, issue text, program."
    ),
)
@click.option(
    "--mcap",
    type=Path,
    metavar="FILE",
    help=(
        "Write what the robot sensed and did, for Foxglove, Rerun and ros2 bag; its runs are "
        "repeated from their seeds."
    ),
)
@click.option(
    "--pytest",
    "test",
    type=Path,
    metavar="FOLDER",
    help="Write a test for pytest that fails as long as the robot fails.",
)
@options.trust_option
def export_command(
    run: str,
    sdf: Path | None,
    passes: bool,
    margin: tuple[str, ...],
    scenario: Path | None,
    bundle: Path | None,
    mcap: Path | None,
    test: Path | None,
    trust: bool,
) -> int:
    """Writes the environment of RUN, the models that are left, to files."""
    from ddenv.report.bundle import write_bundle, write_test
    from ddenv.runfile.store import RunFile
    from ddenv.runs.export import export_world

    path = find_run(run)
    if sdf is None and bundle is None and mcap is None and test is None:
        RunFile(path).close()
        raise UserError(
            "nothing to export: give --sdf FILE, --bundle FOLDER, --mcap FILE or --pytest FOLDER"
        )
    for given, option in (
        (scenario is not None, "--scenario"),
        (passes, "--passes"),
        (bool(margin), "--margin"),
    ):
        if given and sdf is None:
            raise UserError(f"{option}: needs --sdf FILE")
    if passes and margin:
        raise UserError("--passes and --margin: give one of them; margins apply to what is left")
    if bundle is not None:
        say_written(write_bundle(path, bundle))
    if test is not None:
        say_written(write_test(path, test))
    if mcap is not None:
        _write_mcap(path, mcap, trust)
    if sdf is not None:
        exported = export_world(path, sdf, scenario, passes, margin)
        say_written(exported.files)
        announce_needs(sdf, exported.needs)
        if exported.whole:
            announce(
                "no failure is known yet: this is the whole world; 'ddenv resume RUN' reduces it"
            )
    return 0


def _write_mcap(run: Path, file: Path, trust: bool) -> None:
    from ddenv.robot import check_drake
    from ddenv.runfile.store import RunFile
    from ddenv.runs.programs import how_to_install
    from ddenv.runs.trust import trusted_scenario

    check_drake()
    try:
        from ddenv.engine.mcap_file import write_mcap
    except ModuleNotFoundError:
        raise UserError(f"--mcap needs another package: {how_to_install('mcap')}") from None
    with RunFile(run) as opened:
        trusted_scenario(opened, asking(trust))
    announce(f"repeating runs of {run.stem} ...")
    lines = write_mcap(run, file)
    print("\n".join([f"wrote {file}", *(f"  {line}" for line in lines)]))


@click.command("reproduce")
@options.run_argument
@click.option(
    "--most",
    type=options.Whole(1, 10_000),
    default=60,
    show_default=True,
    help="Maximum number of runs.",
)
@click.option(
    "--folder",
    type=click.Path(exists=True, file_okay=False, path_type=Path),
    help="Folder of your own controller or simulator; by default that of the run's scenario.",
)
@options.jobs_option("Runs")
@options.trust_option
@options.json_option
def reproduce_command(
    run: str, most: int, folder: Path | None, jobs: int, trust: bool, as_json: bool
) -> int:
    """Runs what is left of RUN (a name or a file) until it is clear whether it still fails at the
    rate of its certificate.

    Exit codes are those of git bisect run: 1 it fails at that rate, 0 it does not (at less than
    half of it), 125 undecided: the runs do not decide, or something is wrong.
    """
    from ddenv.cli.test import line
    from ddenv.engine.single_test import expected, reproduce, subject_in
    from ddenv.runs.trust import check_trusted

    path = find_run(run)
    subject = subject_in(path, folder)
    certificate = expected(subject, path)
    claim = certificate.claims[0]
    check_trusted(subject.scenario, path, asking(trust))
    for result, so_far in reproduce(subject, certificate, most, jobs):
        found = so_far
        if not as_json:
            print(line(result), flush=True)
    if as_json:
        print(json.dumps(asdict(found) | {"expected": {"low": claim.low, "high": claim.high}}))
    else:
        rate = f"{percent(claim.low)} to {percent(claim.high)}"
        print(f"{found}; {'each run with a chosen seed' if certificate.seeds else rate} expected")
    return {True: FAILS, False: PASSES, None: CANNOT_SAY}[found.fails]
