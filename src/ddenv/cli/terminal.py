"""What a terminal shows: lines as wide as it is, slow steps, what was written, and questions."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Callable, Iterable
from functools import lru_cache
from typing import TextIO

import click

from ddenv.text import printable, width

# How `git bisect run` reads an exit code.
CANNOT_SAY = 125
# Takes back the line of a terminal.
CLEAR = "\r\x1b[K"
# The minimum width for readable text, columns.
LEAST = 8


def terminal_columns(stream: TextIO | None = None) -> int | None:
    """How wide the terminal is, columns; None where `stream`, by default stdout, goes elsewhere."""
    if (stream or sys.stdout).isatty():
        return shutil.get_terminal_size().columns
    return None


def wrapped(text: str, columns: int | None, first: str = "") -> list[str]:
    """`first` and `text` in lines of at most `columns`, broken between words; the lines below hang
    under the text, which may be indented.

    A word that is wider than a line, such as a path, comes in pieces. In one line if `columns` is
    None.
    """
    if columns is None:
        return [first + text]
    from rich.console import Console
    from rich.text import Text

    first += text[: len(text) - len(text.lstrip(" "))]
    lines = Text(" ".join(text.split())).wrap(Console(), max(LEAST, columns - width(first)))
    below = " " * width(first)
    return [
        f"{below if number else first}{line.plain.rstrip()}"
        for number, line in enumerate(lines or [Text()])
    ]


def say(text: str, first: str = "") -> None:
    """Prints `text` in lines as wide as the terminal."""
    print("\n".join(wrapped(printable(text), terminal_columns(), first)))


def say_written(files: Iterable[object]) -> None:
    for file in files:
        print(printable(f"wrote {file}"))


def announce(line: str) -> None:
    """Says on stderr what is going on, or wrong, so that programs can read stdout."""
    print(
        "\n".join(wrapped(printable(line), terminal_columns(sys.stderr))),
        file=sys.stderr,
        flush=True,
    )


@lru_cache(maxsize=1)
def show_progress(words: str) -> None:
    """Says on stderr how far a slow step is, once in the same words: on a terminal in one line,
    which "" takes back.
    """
    if sys.stderr.isatty():
        print(f"{CLEAR}{words}", end="", file=sys.stderr, flush=True)
    elif words:
        announce(words)


def asking(trust: bool) -> Callable[[str], bool]:
    """Answers whether a program is trusted: yes with `trust`, else what the user says on a
    terminal, and no without one.
    """

    def answer(question: str) -> bool:
        asks = sys.stdin.isatty() and sys.stderr.isatty()
        return trust or (asks and click.confirm(printable(question), err=True))

    return answer
