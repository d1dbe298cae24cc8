"""Downloads the models that a world or a robot lacks, with a bar for each on the terminal:
`--fetch`.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ddenv.cli.terminal import announce
from ddenv.text import printable

if TYPE_CHECKING:
    from ddenv.runs.experiment import Parse
    from ddenv.world.files.fuel import FuelModel
    from ddenv.world.files.fuel_download import Shown
    from ddenv.world.scenario import Reading

LEAVE_OUT = "leave it out with --stand-in {}"


def fetch_with_bar(file: Path, reading: Reading, parse: Parse) -> None:
    """Downloads the models in Fuel that `file` lacks, which `parse` reads. Raises UserError."""
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TransferSpeedColumn

    from ddenv.runs.fetching import fetch_missing

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        DownloadColumn(),
        TransferSpeedColumn(),
    )
    console = Console(stderr=True)
    with Progress(
        *columns, console=console, transient=True, disable=not sys.stderr.isatty()
    ) as bars:

        def bar_of(model: FuelModel) -> Shown:
            bar = bars.add_task(escape(printable(model.name)), total=None)
            return lambda received, total: bars.update(bar, completed=received, total=total)

        fetch_missing(file, reading, parse, show=bar_of, tell=announce, advice=LEAVE_OUT)
