"""Text in lines as wide as a terminal."""

from __future__ import annotations

import json
import shutil
import sys
from collections.abc import Iterator

import click

from ddenv.errors import printable
from ddenv.map.names import width
from ddenv.schemas import Kind, explanation, names

# Nothing can be read in less, columns.
LEAST = 8


def wrapped(text: str, columns: int | None, first: str = "") -> list[str]:
    """`first` and `text` in lines of at most `columns`, broken between words; the lines below hang under the text.

    In one line if `columns` is None.
    """
    if columns is None:
        return [first + text]
    columns = max(LEAST, columns - width(first))
    lines = [""]
    for word in _words(text, columns):
        longer = f"{lines[-1]} {word}" if lines[-1] else word
        if width(longer) <= columns:
            lines[-1] = longer
        else:
            lines.append(word)
    hanging = " " * width(first)
    return [first + lines[0], *(hanging + line for line in lines[1:])]


def cut(text: str, columns: int | None) -> str:
    """`text` without its end, where it is wider than `columns`."""
    if columns is None or width(text) <= columns:
        return text
    text = text[:columns]
    while text and width(text) >= columns:
        text = text[:-1]
    return f"{text}…"


def _words(text: str, columns: int) -> Iterator[str]:
    """The words of a text; one that is wider than a line, such as a path, comes in pieces."""
    for word in text.split():
        piece = ""
        for char in word:
            if width(piece + char) > columns:
                yield piece
                piece = ""
            piece += char
        yield piece


KINDS: tuple[Kind, ...] = ("partitioning", "prioritization", "algorithm")
TITLES: dict[Kind, str] = {
    "partitioning": "partitionings: how the environment is split",
    "prioritization": "prioritizations: in which order the parts are tried",
    "algorithm": "algorithms: how the environment is searched",
}


def report() -> dict[str, dict[str, str]]:
    """What `--json` prints: of each kind, the explanations by name."""
    return {f"{kind}s": {name: explanation(kind, name) for name in names(kind)} for kind in KINDS}


def lines(columns: int | None = None) -> list[str]:
    """A paragraph for each, no line wider than `columns`; each is one line if that is None."""
    told: list[str] = []
    for kind in KINDS:
        told += ["", *wrapped(TITLES[kind], columns)] if told else wrapped(TITLES[kind], columns)
        for name in names(kind):
            told += ["", *_paragraph(printable(name), printable(explanation(kind, name)), columns)]
    return told


def _paragraph(name: str, words: str, columns: int | None) -> list[str]:
    """The name, and below it the words."""
    return [*wrapped(name, columns, "  "), *wrapped(words or "(nothing is said of it)", columns, "    ")]


@click.command("schemas")
@click.option("--json", "as_json", is_flag=True, help="Print one object with everything.")
def schemas_command(as_json: bool) -> int:
    """Lists the partitionings, prioritizations and algorithms, each with its explanation."""
    from ddenv.cli.schemas_command import lines, report

    columns = shutil.get_terminal_size().columns if sys.stdout.isatty() else None
    print(json.dumps(report()) if as_json else "\n".join(lines(columns)))
    return 0
