"""Commands that start an engine and follow it without a screen: `ddenv run`, and on a run `resume`
and `certify`.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ddenv.cli import options
from ddenv.cli.terminal import announce, asking
from ddenv.errors import UserError
from ddenv.runs.folder import find_run, run_path
from ddenv.settings import CHANGEABLE, SETTINGS, Value, number_text
from ddenv.text import count, first_of, printable, shortened
from ddenv.world.access import is_world

if TYPE_CHECKING:
    from ddenv.runfile.state import RunState
    from ddenv.world.model import World

# Columns.
LONGEST_URI = 80


@click.command("run")
@click.argument("scenario", shell_complete=options.scenarios)
@options.scenario_options
@options.reading_options
@options.fetch_option
@options.setting_options()
@click.option(
    "--exact",
    is_flag=True,
    help=(
        "Reduce failing runs of the baseline themselves, each repeated with its seed, as "
        "--accept-rate exact does."
    ),
)
@click.option(
    "--protect", multiple=True, metavar="MODEL", help="A model that always stays; may be repeated."
)
@options.jobs_option()
@click.option("--name", help="Name of the run.")
@click.option(
    "--output",
    type=Path,
    help="A .ddenv file or a folder for the run; or an .sdf file for the minimal world.",
)
@options.trust_option
@options.json_option
def run_command(
    scenario: str,
    name: str | None,
    output: Path | None,
    jobs: int,
    trust: bool,
    as_json: bool,
    **given: Any,
) -> int:
    """Reduces SCENARIO (ditch, rubble, friction, a YAML file, an SDF world or model directives)
    without a screen.
    """
    from ddenv.cli.follow import follow_to_summary
    from ddenv.runs.creation import create_named
    from ddenv.runs.engine_job import EngineOptions
    from ddenv.runs.export import export_world
    from ddenv.runs.programs import start_engine

    if given.pop("exact"):
        given["accept_rate"] = "exact"
    path, world = create_named(scenario, given, asking(trust), name, output, announce)
    announce_notes(world, as_json)
    engine = start_engine(path, EngineOptions(jobs=jobs))
    code, state = follow_to_summary(path, engine, as_json)
    if output is not None and is_world(output) and state.baseline is not None:
        announce_needs(output, export_world(path, output, None).needs)
    return code


def announce_notes(world: World, as_json: bool) -> None:
    """Counts the parts of a world that were replaced or ignored, if any."""
    if world.notes:
        were = (
            f"{count(len(world.notes), 'part')} of {world.path} "
            f"{'was' if len(world.notes) == 1 else 'were'}"
        )
        line = f"{were} replaced or ignored; 'ddenv world check' says which and why"
        print(printable(line), file=sys.stderr if as_json else sys.stdout, flush=True)


def announce_needs(sdf: Path, uris: list[str]) -> None:
    """Lists the other files that a written world still needs, since it keeps their names."""
    if uris:
        announce(f"{sdf} still needs {first_of([shortened(uri, LONGEST_URI) for uri in uris], 3)}")


@click.command("resume")
@options.run_argument
@click.option(
    "--mixed",
    is_flag=True,
    help="Continue even if other versions or another processor change results.",
)
@click.option(
    "--anyway", is_flag=True, help="Continue even if the engine has died again and again."
)
@click.option("--again", is_flag=True, help="Repeat all tests in a new run of the same scenario.")
@options.setting_options(only=(*CHANGEABLE, "timeout"))
@options.engine_options
def resume_command(
    run: str,
    jobs: int,
    cluster: str | None,
    mixed: bool,
    anyway: bool,
    again: bool,
    trust: bool,
    as_json: bool,
    timeout: float | None,
    **given: Value,
) -> int:
    """Continues RUN (a name or a file) without a screen; no finished test is repeated.

    With new settings it goes on as key c of the workbench does; with another epsilon or failure all
    stored ends are judged again. Another timeout needs --again.

    If Drake, Python or the processor has changed, the first run of the whole world is repeated and
    compared.
    """
    from ddenv.cli.follow import follow_to_summary
    from ddenv.guiding.commands import Change, Context, send
    from ddenv.runfile.fold import fold
    from ddenv.runfile.lock import engine_lock
    from ddenv.runfile.store import RunFile
    from ddenv.runs.creation import create_like
    from ddenv.runs.engine_job import EngineOptions
    from ddenv.runs.programs import start_engine
    from ddenv.runs.trust import trusted_scenario

    path = find_run(run)
    if mixed and again:
        raise UserError("--mixed and --again: give one of them")
    # 0 takes back a limit.
    new = {
        name: None if value == 0 and SETTINGS[name].none else value
        for name, value in given.items()
        if value is not None
    }
    if new and again:
        raise UserError(
            "--again repeats the tests of the same scenario: leave out the new settings"
        )
    if timeout is not None and not again:
        raise UserError(
            "--timeout: with another one every run may end elsewhere, so no stored end can be "
            "judged again; "
            f"'ddenv resume {run} --again --timeout {number_text(timeout)}' makes all tests in a "
            "new run"
        )
    with RunFile(path) as file:
        scenario = trusted_scenario(file, asking(trust), cluster)
        if not again:
            with engine_lock(path):
                if new:
                    change = Change(new)
                    if why := change.refusal(Context(fold(file.events()))):
                        raise UserError(why)
                    send(file, change)
                # Going back while no engine works ends in a pause, and without a screen nobody can
                # end it.
                if any(
                    command.kind == "go_back"
                    for command in file.commands(fold(file.events()).last_command)
                ):
                    file.send("resume")
    # Without a screen there is nobody to ask.
    how = EngineOptions(
        jobs=jobs,
        cluster=cluster,
        accept_mode="automatic",
        allow_other_machine=mixed,
        ignore_crashes=anyway,
    )
    if again:
        if timeout is not None:
            failure = scenario.failure.model_copy(update={"timeout": timeout})
            scenario = scenario.model_copy(update={"failure": failure})
        copy = run_path(scenario.name, None, path.parent)
        create_like(path, scenario, copy)
        announce(f"repeating the tests of {path} in {copy}")
        path = copy
        how = EngineOptions(jobs=jobs, cluster=cluster)
    return follow_to_summary(path, start_engine(path, how), as_json)[0]


@click.command("certify")
@options.run_argument
@click.option(
    "--runs",
    type=options.Whole(1),
    metavar="N",
    help="Minimum number of runs of what is left; by default as many as the baseline has.",
)
@click.option(
    "--certify-rate",
    type=float,
    metavar="PART",
    help=(
        "Continue the last certificate, with all of its runs, until it shows that this share of "
        "the rate is kept."
    ),
)
@options.engine_options
def certify_command(
    run: str,
    runs: int | None,
    certify_rate: float | None,
    jobs: int,
    cluster: str | None,
    trust: bool,
    as_json: bool,
) -> int:
    """Certifies what is left of RUN (a name or a file) once more, with fresh seeds; it changes
    nothing else.
    """
    from ddenv.cli.follow import follow_to_summary
    from ddenv.runfile.run_settings import settings
    from ddenv.runs.engine_job import Certify, EngineOptions
    from ddenv.runs.programs import start_engine

    path, state = idle_run(run, trust, cluster)
    share = SETTINGS["certify_rate"]
    if certify_rate is not None and not share.allows(certify_rate):
        raise UserError(f"--certify-rate: expected {share.wanted}, found {certify_rate}")
    if state.baseline is None:
        raise UserError(
            f"{path}: f is not known yet, so there is nothing to certify; run it first: ddenv "
            f"resume {path}"
        )
    if state.status != "finished" and not (state.confirming and state.ended):
        raise UserError(
            f"{path}: its search has not finished; finish it first: ddenv resume {path}"
        )
    at_least = runs or settings(state).baseline_runs
    job = Certify(at_least=at_least, certify_rate=certify_rate)
    engine = start_engine(path, EngineOptions(jobs=jobs, cluster=cluster), job)
    return follow_to_summary(path, engine, as_json)[0]


def idle_run(run: str, trust: bool, cluster: str | None) -> tuple[Path, RunState]:
    """The file and the state of a run that no engine works on, and that may start what it brings
    along. Raises UserError.
    """
    from ddenv.runfile.fold import fold
    from ddenv.runfile.lock import engine_lock
    from ddenv.runfile.store import RunFile
    from ddenv.runs.trust import trusted_scenario

    path = find_run(run)
    with RunFile(path) as file:
        trusted_scenario(file, asking(trust), cluster)
        with engine_lock(path):
            return path, fold(file.events())
