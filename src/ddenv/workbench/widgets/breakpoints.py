"""The classes that a screen has at a size."""

from __future__ import annotations

from typing import Any

from textual.geometry import Size
from textual.screen import Screen


def classes_at(screen: type[Screen[Any]], size: Size) -> str:
    """The classes of its breakpoints. A screen that begins with them computes its styles and its layout once, not twice."""
    sides = (screen.HORIZONTAL_BREAKPOINTS or (), size.width), (screen.VERTICAL_BREAKPOINTS or (), size.height)
    return " ".join(max(each for each in steps if each[0] <= length)[1] for steps, length in sides if steps)
