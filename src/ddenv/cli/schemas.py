"""`ddenv schemas`: what a world can be reduced by, and what is said of each."""

from __future__ import annotations

import json
import shutil
import sys

import click


@click.command("schemas")
@click.option("--json", "as_json", is_flag=True, help="Print one object with everything.")
def schemas_command(as_json: bool) -> int:
    """Lists the partitionings, prioritizations and algorithms, each with its explanation."""
    from ddenv.console.schemas import lines, report

    columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    print(json.dumps(report()) if as_json else "\n".join(lines(columns)))
    return 0
