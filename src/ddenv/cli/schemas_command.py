"""`ddenv schemas`: every partitioning, prioritization and algorithm, explained."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click

from ddenv.cli.wrapping import terminal_columns, wrapped
from ddenv.text import printable

if TYPE_CHECKING:
    from ddenv.schemas import Kind

KINDS: tuple[Kind, ...] = ("partitioning", "prioritization", "algorithm")
TITLES: dict[Kind, str] = {
    "partitioning": "partitionings: how the environment is split",
    "prioritization": "prioritizations: in which order the parts are tried",
    "algorithm": "algorithms: how the environment is searched",
}


def report() -> dict[str, dict[str, str]]:
    """The object that `--json` prints: the explanations of each kind by name."""
    from ddenv.schemas import explanation, names

    return {f"{kind}s": {name: explanation(kind, name) for name in names(kind)} for kind in KINDS}


def lines(columns: int | None = None) -> list[str]:
    """A paragraph for each, no line wider than `columns`; each is one line if that is None."""
    from ddenv.schemas import explanation, names

    said: list[str] = []
    for kind in KINDS:
        said += ["", *wrapped(TITLES[kind], columns)] if said else wrapped(TITLES[kind], columns)
        for name in names(kind):
            said += ["", *_paragraph(printable(name), printable(explanation(kind, name)), columns)]
    return said


def _paragraph(name: str, words: str, columns: int | None) -> list[str]:
    """The name, and below it the words."""
    return [*wrapped(name, columns, "  "), *wrapped(words or "(no explanation)", columns, "    ")]


@click.command("schemas")
@click.option("--json", "as_json", is_flag=True, help="Print one object with everything.")
def schemas_command(as_json: bool) -> int:
    """Lists the partitionings, prioritizations and algorithms, each with its explanation."""
    columns = terminal_columns()
    print(json.dumps(report()) if as_json else "\n".join(lines(columns)))
    return 0
