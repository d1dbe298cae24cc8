"""`ddenv report`: a run as one page."""

from __future__ import annotations

from pathlib import Path

import click


@click.command("report")
@click.argument("run")
@click.option(
    "-o",
    "--output",
    "file",
    type=Path,
    required=True,
    metavar="FILE",
    help="A .html page, or a .md file with its pictures beside it.",
)
@click.option("--force", is_flag=True, help="Replace files that exist.")
def report_command(run: str, file: Path, force: bool) -> int:
    """Writes a report on RUN: one page to read, print or mail."""
    from ddenv.report.report import write_report
    from ddenv.runs.folder import find_run

    for path in write_report(find_run(run), file, force):
        print(f"wrote {path}")
    return 0
