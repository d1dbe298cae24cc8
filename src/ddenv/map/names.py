"""The width of names on a terminal, and names shortened or padded to a width."""

from __future__ import annotations

import unicodedata

from ddenv.errors import printable


def width(text: str) -> int:
    """The number of terminal columns that `text` takes."""
    return sum(_width(char) for char in text)


def _width(char: str) -> int:
    if unicodedata.category(char) in ("Mn", "Me", "Cf"):
        return 0
    return 2 if unicodedata.east_asian_width(char) in "WF" else 1


def shortened(name: str, columns: int) -> str:
    """`name` without control characters, cut in its middle to `columns`: names of copies differ at their ends."""
    name = printable(name)
    if width(name) <= columns:
        return name
    head, tail = "", ""
    while True:
        take_head = width(head) <= width(tail)
        char = name[len(head)] if take_head else name[-1 - len(tail)]
        if width(head) + width(tail) + _width(char) + 1 > columns:
            return f"{head}…{tail}" if columns > 0 else ""
        head, tail = (head + char, tail) if take_head else (head, char + tail)


def padded(text: str, columns: int) -> str:
    """`text` filled with spaces to `columns`."""
    return text + " " * (columns - width(text))
