"""Commands that only look: `ddenv runs`, `diff`, `schemas`, `config` and `doctor`."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from itertools import groupby
from pathlib import Path

import click

from ddenv.cli.options import json_option, runs, runs_and_scenarios
from ddenv.cli.terminal import say, terminal_columns, wrapped
from ddenv.doctor import Finding, is_well
from ddenv.errors import UserError
from ddenv.runs.folder import find_run, runs_folder
from ddenv.schemas import Kind, explanation, names
from ddenv.text import printable

TITLES: dict[Kind, str] = {
    "partitioning": "partitionings: how the environment is split",
    "prioritization": "prioritizations: in which order the parts are tried",
    "algorithm": "algorithms: how the environment is searched",
}
SIGNS = {"ok": " ", "note": "!", "wrong": "✗"}


@click.command("runs")
def runs_command() -> int:
    """Lists the runs."""
    from ddenv.workbench.runs.recent_runs import RunsFolder

    found = RunsFolder(runs_folder()).look()
    if not found:
        print(f"no runs yet in {runs_folder()}; 'ddenv run ditch' makes one")
    width = max((len(run.path.stem) for run in found), default=0)
    for run in found:
        if run.minimal:
            status = "minimal"
        elif run.status == "lost":
            status = "engine not running"
        else:
            status = run.status
        size = f"{len(run.kept)} of {run.total} models"
        says = run.trouble or f"{status:<18}  {size:<20}  {run.tests} tests"
        print(printable(f"{run.path.stem:<{width}}  {says}"))
    return 0


@click.command("diff")
@click.argument("first", metavar="SCENARIO_OR_RUN", shell_complete=runs_and_scenarios)
@click.argument("second", metavar="SCENARIO_OR_RUN", shell_complete=runs_and_scenarios)
@json_option
def diff_command(first: str, second: str, as_json: bool) -> int:
    """Shows in what two runs, or two scenarios, differ: how they ended, which models are there, and
    their settings.

    Of a run, the models are those that are left. Models of one name that differ in place, size or
    friction are listed, too.
    """
    from ddenv.runs.comparison import as_recent, compared, unlike
    from ddenv.runs.experiment import open_experiment

    subjects = [
        open_experiment(name, dict.fromkeys(("spawn", "goal", "world"))) for name in (first, second)
    ]
    one, other = (
        as_recent(name, each) for name, each in zip((first, second), subjects, strict=True)
    )
    models = unlike(subjects[0].world, subjects[1].world)
    rows = [row for row in (*compared(one, other), *models) if row[1] != row[2]]
    if as_json:
        keys = ("what", "first", "second")
        print(json.dumps({"differences": [dict(zip(keys, row, strict=True)) for row in rows]}))
        return 0
    width = max(len(name) for name, *_ in rows)
    for name, value, another in rows:
        say(f"{value} | {another}", f"{name:<{width}}  ")
    return 0


@click.command("schemas")
@click.option("--json", "as_json", is_flag=True, help="Print one object with everything.")
def schemas_command(as_json: bool) -> int:
    """Lists the partitionings, prioritizations and algorithms, each with its explanation."""
    print(json.dumps(schemas_report()) if as_json else "\n".join(schemas_lines(terminal_columns())))
    return 0


def schemas_report() -> dict[str, dict[str, str]]:
    """The object that `--json` prints: the explanations of each kind by name."""
    return {f"{kind}s": {name: explanation(kind, name) for name in names(kind)} for kind in TITLES}


def schemas_lines(columns: int | None = None) -> list[str]:
    """A paragraph for each, no line wider than `columns`; each is one line if that is None."""
    said: list[str] = []
    for kind, title in TITLES.items():
        said += ["", *wrapped(title, columns)]
        for name in names(kind):
            words = printable(explanation(kind, name)) or "(no explanation)"
            said += ["", *wrapped(printable(name), columns, "  "), *wrapped(words, columns, "    ")]
    return said[1:]


@click.command("config")
@click.option("--example", is_flag=True, help="Print an example file with every action.")
def config_command(example: bool) -> int:
    """Shows the path of the file with your keys and theme, and lists all actions with their
    keys.
    """
    from ddenv.workbench.config import example_lines, lines

    print("\n".join(example_lines() if example else lines()))
    return 0


@click.command("doctor")
@click.argument("run", required=False, shell_complete=runs)
@click.option(
    "--repair",
    type=Path,
    metavar="COPY",
    help="Write the readable part of a damaged RUN to COPY; RUN stays unchanged.",
)
@json_option
def doctor_command(run: str | None, repair: Path | None, as_json: bool) -> int:
    """Checks the installation, the terminal and the machine; with RUN (a name or a file) also that
    run.

    Exits with 1 if something is wrong.
    """
    from ddenv.doctor.machine import installation, machine, terminal
    from ddenv.doctor.machine import runs as folder_of_runs
    from ddenv.doctor.run_health import repair as repaired
    from ddenv.doctor.run_health import run_health

    if run is None and repair is not None:
        raise UserError("--repair: needs a run: ddenv doctor RUN --repair COPY")
    if run is None:
        found = [*installation(), *terminal(), *machine(), *folder_of_runs()]
    else:
        found = [
            *(repaired(find_run(run), repair) if repair is not None else run_health(find_run(run)))
        ]
        # Asked about one run, only what is wrong elsewhere is worth a line.
        found += [
            finding for finding in (*installation(), *folder_of_runs()) if finding.state == "wrong"
        ]
    if as_json:
        print(
            json.dumps({"well": is_well(found), "findings": [asdict(finding) for finding in found]})
        )
    else:
        print("\n".join(map(printable, finding_lines(found, terminal_columns()))))
    if is_well(found):
        return 0
    return 1


def finding_lines(found: Iterable[Finding], columns: int | None) -> Iterator[str]:
    """The findings by group, in aligned lines as wide as the terminal; then what that comes to."""
    found = list(found)
    width = max(len(finding.what) for finding in found)
    for group, members in groupby(found, key=lambda finding: finding.group):
        yield group
        for finding in members:
            yield from wrapped(
                finding.says, columns, f"{SIGNS[finding.state]} {finding.what:<{width}}  "
            )
            if finding.advice:
                yield from wrapped(finding.advice, columns, f"  {'':<{width}}  → ")
    wrong, notes = (sum(finding.state == state for finding in found) for state in ("wrong", "note"))
    if wrong:
        yield f"✗ {wrong} wrong"
    elif notes:
        yield f"all is well; ! {notes} worth a look"
    else:
        yield "all is well"
