"""Which lines of a widget have to be drawn again."""

from __future__ import annotations

from itertools import zip_longest

from rich.text import Text
from textual.geometry import Region


def changed_lines(before: Text, now: Text, width: int) -> list[Region]:
    """The lines in which two texts differ, as regions of a widget of so many columns."""
    pairs = zip_longest(before.split("\n"), now.split("\n"))
    return [Region(0, y, width, 1) for y, (old, new) in enumerate(pairs) if old != new]
