"""Commands that show what runs found, and write it to files: `ddenv runs`, `why`, `report` and `export`."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import click

from ddenv.cli.options import json_option, run_argument, trust_option
from ddenv.cli.terminal import announce, announced, asking, say, say_written
from ddenv.errors import UserError
from ddenv.runs.folder import SUFFIX, find_run, runs_folder
from ddenv.text import first_of, printable, shortened

# Columns.
LONGEST_URI = 80


@click.command("runs")
def runs_command() -> int:
    """Lists the runs."""
    lines = run_lines(runs_folder())
    print("\n".join(lines) if lines else f"no runs yet in {runs_folder()}; 'ddenv run ditch' makes one")
    return 0


def run_lines(folder: Path) -> list[str]:
    """One line a run, newest first: name, status, models left, tests. A damaged file says so in its line."""
    paths = sorted((path for path in folder.glob(f"*{SUFFIX}") if path.is_file()), key=_changed, reverse=True)
    width = max((len(path.stem) for path in paths), default=0)
    return [printable(f"{path.stem:<{width}}  {_line(path)}") for path in paths]


def _changed(path: Path) -> float:
    try:
        return path.stat().st_mtime
    except FileNotFoundError:
        return 0.0


def _line(path: Path) -> str:
    from ddenv.runfile.fold import fold
    from ddenv.runfile.lock import engine_is_alive
    from ddenv.runfile.store import RunFile

    try:
        with RunFile(path) as file:
            state = fold(file.events())
    except UserError as error:
        return str(error)
    status = state.status
    if not state.ended and status != "created" and not engine_is_alive(path):
        status = "engine not running"
    elif status == "finished" and state.minimal:
        status = "minimal"
    size = f"{len(state.environment)} of {len(state.elements)} models"
    return f"{status:<18}  {size:<20}  {state.tests_done} tests"


@click.command("why")
@run_argument
@json_option
def why_command(run: str, as_json: bool) -> int:
    """Says why the robot fails in what RUN (a name or a file) has left: what it does without each model, and where the ways part.

    The fresh runs of the certificate show it; no new test is made. After 'ddenv isolate RUN' it also says what the nearest world
    that passes lacks.
    """
    from ddenv.evidence.claims import current
    from ddenv.runfile.fold import fold
    from ddenv.runfile.store import RunFile
    from ddenv.runs.nearest import nearest
    from ddenv.runs.reasons import no_reasons, parting_sentence, reasons, sentence

    with RunFile(find_run(run)) as file:
        state = fold(file.events())
        passing, certificate = nearest(file, state), current(state)
        found = () if passing is not None and certificate is None else reasons(file, state)
    if as_json:
        said = [asdict(each) | {"words": sentence(each)} for each in found]
        print(json.dumps({"reasons": said, "nearest": None if passing is None else asdict(passing)}))
        return 0
    for each in found:
        say(f"{sentence(each)} {parting_sentence(each)}".rstrip(), "- ")
    if passing is not None:
        say(passing.sentences)
    if not found and certificate is not None:
        say(no_reasons(certificate))
    return 0


@click.command("report")
@run_argument
@click.option(
    "-o",
    "--output",
    "file",
    type=Path,
    metavar="FILE",
    help="A .html page, or a .md file with its pictures beside it; has to be given.",
)
@click.option("--force", is_flag=True, help="Replace files that exist.")
def report_command(run: str, file: Path | None, force: bool) -> int:
    """Writes a report on RUN: one page to read, print or mail."""
    from ddenv.report.report import write_report
    from ddenv.runfile.store import RunFile

    path = find_run(run)
    with RunFile(path):
        # A run that is not there needs no file either.
        if file is None:
            raise UserError(f"give the file to write, such as -o {path.stem}.html")
    say_written(write_report(path, file, force))
    return 0


@click.command("export")
@run_argument
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

    path = find_run(run)
    with RunFile(path):
        # A run that is not there needs no file either.
        if all(each is None for each in (sdf, bundle, mcap, test)):
            raise UserError("nothing to export: give --sdf FILE, --bundle FOLDER, --mcap FILE or --pytest FOLDER")
    for given, option in ((scenario is not None, "--scenario"), (passes, "--passes")):
        if given and sdf is None:
            raise UserError(f"{option}: needs --sdf FILE")
    written = [] if bundle is None else write_bundle(path, bundle)
    say_written(written + ([] if test is None else write_test(path, test)))
    if mcap is not None:
        _write_mcap(path, mcap, trust)
    if sdf is not None:
        exported = export_world(path, sdf, scenario, passes)
        say_written(exported.files)
        announce_needs(sdf, exported.needs)
    return 0


def _write_mcap(run: Path, file: Path, trust: bool) -> None:
    from ddenv.engine.mcap_file import write_mcap
    from ddenv.robot import check_drake
    from ddenv.runfile.store import RunFile
    from ddenv.runs.trust import trusted_scenario

    check_drake()
    with RunFile(run) as opened:
        trusted_scenario(opened, asking(trust))
    with announced(f"making runs of {run.stem} again ...") as say_so:
        lines = write_mcap(run, file, lambda name, seconds: say_so(f"/{name}: {seconds:.1f} s made again"))
    print("\n".join([f"wrote {file}", *(f"  {line}" for line in lines)]))


def announce_needs(sdf: Path, uris: list[str]) -> None:
    """Lists the other files that a written world still needs, since it keeps their names."""
    if uris:
        announce(f"{sdf} still needs {first_of([shortened(uri, LONGEST_URI) for uri in uris], 3)}")
