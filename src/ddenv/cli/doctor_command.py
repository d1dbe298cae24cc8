"""`ddenv doctor`: what is well and what is not."""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator
from dataclasses import asdict
from itertools import groupby
from pathlib import Path

import click

from ddenv.cli.options import json_option, runs
from ddenv.cli.terminal import terminal_columns, wrapped
from ddenv.cli.workbench_command import PORT
from ddenv.doctor import Finding, is_well
from ddenv.errors import UserError
from ddenv.text import printable

SIGNS = {"ok": " ", "note": "!", "wrong": "✗"}


@click.command("doctor")
@click.argument("run", required=False, shell_complete=runs)
@click.option(
    "--repair", type=Path, metavar="COPY", help="Write all that is whole of RUN to a new run file; RUN stays as it is."
)
@json_option
def doctor_command(run: str | None, repair: Path | None, as_json: bool) -> int:
    """Checks the installation, the terminal and the machine; with RUN (a name or a file) also that run.

    Exits with 1 if something is wrong.
    """
    if run is None and repair is not None:
        raise UserError("--repair: needs a run: ddenv doctor RUN --repair COPY")
    found = list(_found(run, repair))
    if as_json:
        print(json.dumps({"well": is_well(found), "findings": [asdict(finding) for finding in found]}))
    else:
        print("\n".join(map(printable, lines(found, terminal_columns()))))
    return 0 if is_well(found) else 1


def _found(run: str | None, copy: Path | None) -> Iterator[Finding]:
    from ddenv.doctor.machine import installation, machine, runs, terminal
    from ddenv.doctor.run_health import repair, run_health
    from ddenv.runs.folder import find_run

    if run is not None:
        # Asked about one run, only what is wrong elsewhere is worth a line.
        yield from (repair(find_run(run), copy) if copy is not None else run_health(find_run(run)))
        yield from (finding for finding in (*installation(), *runs()) if finding.state == "wrong")
        return
    from ddenv.runs.programs import FIRST_PORT

    yield from (*installation(), *terminal(), *machine({"scene": FIRST_PORT, "serve": PORT}), *runs())


def lines(found: Iterable[Finding], columns: int | None) -> Iterator[str]:
    """The findings by group, in aligned lines as wide as the terminal; then what that comes to."""
    found = list(found)
    width = max(len(finding.what) for finding in found)
    for group, members in groupby(found, key=lambda finding: finding.group):
        yield group
        for finding in members:
            yield from wrapped(finding.says, columns, f"{SIGNS[finding.state]} {finding.what:<{width}}  ")
            if finding.advice:
                yield from wrapped(finding.advice, columns, f"  {'':<{width}}  → ")
    wrong = sum(finding.state == "wrong" for finding in found)
    notes = sum(finding.state == "note" for finding in found)
    yield f"✗ {wrong} wrong" if wrong else "all is well" + (f"; ! {notes} worth a look" if notes else "")
