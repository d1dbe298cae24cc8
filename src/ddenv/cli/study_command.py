"""`ddenv study`: many reductions side by side."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from ddenv.cli.options import JOBS, search_options


@click.command("study")
@click.option(
    "--scenarios",
    multiple=True,
    metavar="NAMES",
    help="Bundled names or YAML files, separated by commas.  [default: ditch,rubble,friction]",
)
@click.option(
    "--pairs",
    default="paper",
    show_default=True,
    metavar="PAIRS",
    help="Pairs separated by commas, 'paper' for its three, or 'all'.",
)
@click.option(
    "--algorithms",
    default="ddenv",
    show_default=True,
    metavar="NAMES",
    help="Algorithms separated by commas, or 'all'.",
)
@click.option("--seeds", type=click.IntRange(1, 1000), default=1, show_default=True, help="Reductions of each.")
@click.option("--jobs", type=click.IntRange(1, 1024), default=JOBS, show_default=True, help="Tests at the same time.")
@click.option(
    "-o",
    "--output",
    "folder",
    type=Path,
    default=Path("study"),
    show_default=True,
    metavar="DIR",
    help="Where the study is written; one that is there goes on.",
)
@search_options
def study_command(scenarios, pairs: str, algorithms: str, seeds: int, jobs: int, folder: Path, **options) -> int:
    """Makes the paper's tables and figures: reduces each scenario with each pair, and writes what came of it.

    Stopped at any moment, the same command goes on where it was. Each reduction is a run in DIR/runs, for 'ddenv open'.
    Where neither the scenario nor an option says otherwise, n grows steadily and what is implied is skipped; the paper's
    algorithm to the letter is --growth paper --skip known.
    """
    from ddenv.study.conduct import conduct
    from ddenv.study.plan import make_plan

    return conduct(make_plan(scenarios, pairs, algorithms, seeds, **options), folder, jobs, sys.stdout)
