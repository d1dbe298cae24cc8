"""`ddenv export`: the environment of a run, as files."""

from __future__ import annotations

from pathlib import Path

import click

from ddenv.cli.completing import runs
from ddenv.cli.options import announce, announced, trust_option
from ddenv.errors import UserError
from ddenv.text import printable

# Columns.
LONGEST_URI = 80


@click.command("export")
@click.argument("run", shell_complete=runs)
@click.option("--sdf", type=Path, help="Write the environment as an SDF world.")
@click.option(
    "--passes",
    is_flag=True,
    help="With --sdf: write the nearest world that passes, in place of what is left ('ddenv isolate RUN' finds it).",
)
@click.option("--scenario", type=Path, help="Write a scenario (YAML) that runs the robot in that world; needs --sdf.")
@click.option(
    "--bundle",
    type=Path,
    metavar="FOLDER_OR_ZIP",
    help="Write all that reproduces the failure on another machine: run, world, scenario, report, an issue's text, a program.",
)
@click.option(
    "--mcap",
    type=Path,
    metavar="FILE",
    help="Write what the robot sensed and did, for Foxglove, Rerun and ros2 bag; its runs are made again from their seeds.",
)
@click.option(
    "--pytest",
    "test",
    type=Path,
    metavar="FOLDER",
    help="Write a test for pytest that fails as long as the robot fails.",
)
@trust_option
def export_command(
    run: str,
    sdf: Path | None,
    passes: bool,
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
    from ddenv.runs.folder import find_run

    path = find_run(run)
    with RunFile(path):
        # A run that is not there needs no file either.
        if all(each is None for each in (sdf, bundle, mcap, test)):
            raise UserError("nothing to export: give --sdf FILE, --bundle FOLDER, --mcap FILE or --pytest FOLDER")
    if sdf is None and scenario is not None:
        raise UserError("--scenario: needs --sdf FILE")
    if sdf is None and passes:
        raise UserError("--passes: needs --sdf FILE")
    written = [] if bundle is None else write_bundle(path, bundle)
    written += [] if test is None else write_test(path, test)
    for file in written:
        print(printable(f"wrote {file}"))
    if mcap is not None:
        _write_mcap(path, mcap, trust)
    if sdf is None:
        return 0
    exported = export_world(path, sdf, scenario, passes)
    for file in exported.files:
        print(printable(f"wrote {file}"))
    announce_needs(sdf, exported.needs)
    return 0


def _write_mcap(run: Path, file: Path, trust: bool) -> None:
    from ddenv.cli.trusting import allow_run
    from ddenv.engine.mcap_file import write_mcap
    from ddenv.robot import check_drake
    from ddenv.runfile.store import RunFile

    check_drake()
    with RunFile(run) as opened:
        allow_run(opened, trust)
    with announced(f"making runs of {run.stem} again ...") as say:
        lines = write_mcap(run, file, lambda name, seconds: say(f"/{name}: {seconds:.1f} s made again"))
    print("\n".join([f"wrote {file}", *(f"  {line}" for line in lines)]))


def announce_needs(sdf: Path, uris: list[str]) -> None:
    """Lists the other files that a written world still needs, since it keeps their names."""
    from ddenv.text import first_of, shortened

    if uris:
        announce(f"{sdf} still needs {first_of([shortened(uri, LONGEST_URI) for uri in uris], 3)}")
