"""Asks whether a program that a scenario or a run brings along may start."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING

import click

from ddenv.text import printable

if TYPE_CHECKING:
    from ddenv.runfile.state import RunState
    from ddenv.runfile.store import RunFile
    from ddenv.world.scenario import Scenario


def allow(scenario: Scenario, where: Path | str, trust: bool) -> None:
    """Returns if what `scenario` starts is trusted; asks on a terminal, unless `trust` says yes. Raises UserError if it is not."""
    from ddenv.runs.trust import check_trusted, untrusted
    from ddenv.runs.trust import trust as remember

    program = untrusted(scenario)
    if program and (trust or _says_yes(f"{where} starts {program.words}. Do you trust it?")):
        remember(program)
    check_trusted(scenario, where)


def _says_yes(question: str) -> bool:
    asks = sys.stdin.isatty() and sys.stderr.isatty()
    return asks and click.confirm(printable(question), err=True)


def allow_named(scenario: Scenario, name: str, trust: bool) -> None:
    """As `allow`, for a scenario that the user named: a file of the user's own is trusted."""
    from ddenv.runs.trust import trust_own

    trust_own(scenario, Path(name))
    allow(scenario, name, trust)


def allow_run(file: RunFile, trust: bool, cluster: str | None = None) -> Scenario:
    """As `allow`, for a run, whose scenario it returns; the user has typed another `cluster`, if any.

    Raises UserError for a damaged file, too.
    """
    from ddenv.runs.clusters import check_cluster, made_here
    from ddenv.runs.subject import read_scenario

    scenario = read_scenario(file)
    check_cluster(cluster or scenario.reduction.cluster)
    allow(made_here(scenario) if cluster else scenario, file.path, trust)
    return scenario


def idle_run(run: str, trust: bool, cluster: str | None) -> tuple[Path, RunState]:
    """The file and the state of a run that no engine works on, and that may start what it brings along. Raises UserError."""
    from ddenv.runfile.fold import fold
    from ddenv.runfile.lock import engine_lock
    from ddenv.runfile.store import RunFile
    from ddenv.runs.folder import find_run

    path = find_run(run)
    with RunFile(path) as file:
        allow_run(file, trust, cluster)
        with engine_lock(path):
            return path, fold(file.events())
