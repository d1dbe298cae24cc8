"""`ddenv run`: a reduction without a screen."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from ddenv.cli.completing import scenarios
from ddenv.cli.options import (
    announce,
    jobs_option,
    json_option,
    reading_options,
    scenario_options,
    setting_options,
    trust_option,
)
from ddenv.text import printable

if TYPE_CHECKING:
    from ddenv.world.model import World


@click.command("run")
@click.argument("scenario", shell_complete=scenarios)
@scenario_options
@reading_options
@setting_options()
@jobs_option()
@click.option("--name", help="Name of the run.")
@click.option(
    "--output", type=Path, help="A .ddenv file or a folder for the run; or an .sdf file for the minimal world."
)
@trust_option
@json_option
def run_command(
    scenario: str, name: str | None, output: Path | None, jobs: int, trust: bool, as_json: bool, **options: Any
) -> int:
    """Reduces SCENARIO (ditch, rubble, friction, a YAML file or an SDF world) without a screen."""
    from ddenv.cli.export_command import announce_needs
    from ddenv.cli.follow import follow_to_summary
    from ddenv.cli.trusting import allow_named
    from ddenv.runs.creation import create_run
    from ddenv.runs.export import export_world
    from ddenv.runs.folder import run_path
    from ddenv.runs.programs import start_engine
    from ddenv.runs.subject import scenario_named
    from ddenv.runs.trust import trust_cluster

    chosen = scenario_named(scenario, options, announce)
    if options["cluster"]:
        trust_cluster(chosen)
    allow_named(chosen, scenario, trust)
    path = run_path(chosen.name, name, output)
    announce_notes(create_run(chosen, path, announce), as_json)
    code, state = follow_to_summary(path, start_engine(path, jobs), as_json)
    if output is not None and output.suffix in (".sdf", ".world") and state.baseline is not None:
        announce_needs(output, export_world(path, output, None).needs)
    return code


def announce_notes(world: World, as_json: bool) -> None:
    """Counts the parts of a world that were replaced or ignored, if any."""
    from ddenv.text import count

    if world.notes:
        were = f"{count(len(world.notes), 'part')} of {world.path} {'was' if len(world.notes) == 1 else 'were'}"
        line = f"{were} replaced or ignored; 'ddenv world check' says which and why"
        print(printable(line), file=sys.stderr if as_json else sys.stdout, flush=True)
