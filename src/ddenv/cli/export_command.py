"""`ddenv export`: the environment of a run, as files."""

from __future__ import annotations

from pathlib import Path

import click

from ddenv.cli.options import announce
from ddenv.errors import UserError

# Columns.
LONGEST_URI = 80


@click.command("export")
@click.argument("run")
@click.option("--sdf", type=Path, help="Write the environment as an SDF world.")
@click.option("--scenario", type=Path, help="Write a scenario (YAML) that runs the robot in that world; needs --sdf.")
def export_command(run: str, sdf: Path | None, scenario: Path | None) -> int:
    """Writes the environment of RUN, the models that are left, to files."""
    from ddenv.runs.export import export_world
    from ddenv.runs.folder import find_run

    if sdf is None:
        raise UserError("nothing to export: give --sdf FILE")
    exported = export_world(find_run(run), sdf, scenario)
    for path in exported.files:
        print(f"wrote {path}")
    announce_needs(sdf, exported.needs)
    return 0


def announce_needs(sdf: Path, uris: list[str]) -> None:
    """Lists the other files that a written world still needs, since it keeps their names."""
    from ddenv.map.names import shortened
    from ddenv.words import first_of

    if uris:
        announce(f"{sdf} still needs {first_of([shortened(uri, LONGEST_URI) for uri in uris], 3)}")
