"""Downloads the models that a world lacks, with a bar for each on the terminal: `--fetch`."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

from ddenv.cli.terminal import announce
from ddenv.text import printable

if TYPE_CHECKING:
    from ddenv.world.files.fuel import FuelModel
    from ddenv.world.files.fuel_download import Shown
    from ddenv.world.scenario import Reading


def fetch_with_bar(world: Path, reading: Reading) -> None:
    """Downloads the models in Fuel that `world` lacks. Raises UserError."""
    from rich.console import Console
    from rich.markup import escape
    from rich.progress import BarColumn, DownloadColumn, Progress, TextColumn, TransferSpeedColumn

    from ddenv.runs.fetching import fetch_missing

    columns = (TextColumn("{task.description}"), BarColumn(), DownloadColumn(), TransferSpeedColumn())
    console = Console(stderr=True)
    with Progress(*columns, console=console, transient=True, disable=not sys.stderr.isatty()) as bars:

        def bar_of(model: FuelModel) -> Shown:
            bar = bars.add_task(escape(printable(model.name)), total=None)
            return lambda received, total: bars.update(bar, completed=received, total=total)

        fetch_missing(world, reading, bar_of, announce)
