"""`ddenv schemas`: every partitioning, prioritization and algorithm, explained."""

from __future__ import annotations

import json
from typing import TYPE_CHECKING

import click

from ddenv.cli.terminal import terminal_columns, wrapped
from ddenv.text import printable

if TYPE_CHECKING:
    from ddenv.schemas import Kind

TITLES: dict[Kind, str] = {
    "partitioning": "partitionings: how the environment is split",
    "prioritization": "prioritizations: in which order the parts are tried",
    "algorithm": "algorithms: how the environment is searched",
}


def report() -> dict[str, dict[str, str]]:
    """The object that `--json` prints: the explanations of each kind by name."""
    from ddenv.schemas import explanation, names

    return {f"{kind}s": {name: explanation(kind, name) for name in names(kind)} for kind in TITLES}


def lines(columns: int | None = None) -> list[str]:
    """A paragraph for each, no line wider than `columns`; each is one line if that is None."""
    from ddenv.schemas import explanation, names

    said: list[str] = []
    for kind, title in TITLES.items():
        said += ["", *wrapped(title, columns)]
        for name in names(kind):
            words = printable(explanation(kind, name)) or "(no explanation)"
            said += ["", *wrapped(printable(name), columns, "  "), *wrapped(words, columns, "    ")]
    return said[1:]


@click.command("schemas")
@click.option("--json", "as_json", is_flag=True, help="Print one object with everything.")
def schemas_command(as_json: bool) -> int:
    """Lists the partitionings, prioritizations and algorithms, each with its explanation."""
    columns = terminal_columns()
    print(json.dumps(report()) if as_json else "\n".join(lines(columns)))
    return 0
