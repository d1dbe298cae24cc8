"""Text in lines as wide as a terminal."""

from __future__ import annotations

import shutil
import sys
from collections.abc import Iterator

from ddenv.text import width

# The minimum width for readable text, columns.
LEAST = 8


def terminal_columns() -> int | None:
    """How wide the terminal is, columns; None where the output goes elsewhere."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else None


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
    """`text` without its end if it is wider than `columns`."""
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
