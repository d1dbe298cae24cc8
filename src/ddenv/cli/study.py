"""`ddenv study`: many reductions side by side."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

import click

from ddenv.cli import options
from ddenv.cli.terminal import asking


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
@click.option(
    "--seeds",
    type=options.Whole(1, 1000),
    default=1,
    show_default=True,
    help="Seeds per scenario and method.",
)
@options.jobs_option()
@click.option(
    "-o",
    "--output",
    "folder",
    type=Path,
    default=Path("study"),
    show_default=True,
    metavar="DIR",
    help="Folder of the study; an existing study continues.",
)
@options.setting_options(without=("pair", "algorithm", "seed", "budget", "timeout", "cluster"))
@options.trust_option
def study_command(
    scenarios: tuple[str, ...], jobs: int, folder: Path, trust: bool, **given: Any
) -> int:
    """Makes the paper's tables and figures: reduces each scenario with each pair, and writes the
    results.

    It can be stopped at any time; the same command continues. Each reduction is a run in DIR/runs,
    for 'ddenv open'. With --as-printed it follows the paper's algorithm to the letter, which needs
    many more tests.
    """
    from ddenv.runs.trust import check_named
    from ddenv.study.conduct import conduct
    from ddenv.study.plan import make_plan, scenario_names

    plan = make_plan(scenarios, **given)
    for scenario, name in zip(plan.scenarios, scenario_names(scenarios), strict=True):
        check_named(scenario, name, asking(trust))
    return conduct(plan, folder, jobs, sys.stdout)
