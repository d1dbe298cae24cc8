"""Text for a terminal or a page: what is safe to print, how wide it is, and as much of it as fits."""

from __future__ import annotations

import unicodedata


def printable(text: str) -> str:
    """`text` with control characters replaced, since parts of it may come from untrusted files."""
    return "".join(char if char.isprintable() else "\N{REPLACEMENT CHARACTER}" for char in text)


def plain(text: object) -> str:
    """`text` on one line without control characters: names come from files, and must not control the terminal."""
    return printable(" ".join(str(text).split()))


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


def truncated(line: str, columns: int) -> str:
    """A maximum of `columns` characters of a line, with an ellipsis at its end if it is longer."""
    return line if len(line) <= columns else f"{line[: max(0, columns - 1)]}…"


def padded(text: str, columns: int) -> str:
    """`text` filled with spaces to `columns`."""
    return text + " " * (columns - width(text))
