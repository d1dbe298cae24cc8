"""`ddenv report`: a run as one page."""

from __future__ import annotations

from pathlib import Path

import click

from ddenv.cli.completing import runs
from ddenv.errors import UserError
from ddenv.text import printable


@click.command("report")
@click.argument("run", shell_complete=runs)
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
    from ddenv.runs.folder import find_run

    path = find_run(run)
    with RunFile(path):
        # A run that is not there needs no file either.
        if file is None:
            raise UserError(f"give the file to write, such as -o {path.stem}.html")
    for written in write_report(path, file, force):
        print(printable(f"wrote {written}"))
    return 0
