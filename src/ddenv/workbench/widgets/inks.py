"""The theme's colours as styles of text."""

from __future__ import annotations

from collections.abc import Mapping

from rich.color import ANSI_COLOR_NAMES
from rich.color import Color as RichColor
from rich.style import Style
from textual.color import Color, ColorParseError


def ink(variables: Mapping[str, str], name: str, *, bold: bool = False) -> Style:
    """The theme's colour `name` as the colour of text; without colour where the theme leaves it to the terminal."""
    try:
        return Style(color=_color(variables[name]), bold=bold or None)
    except (KeyError, ColorParseError):
        return Style(bold=bold or None)


def _color(value: str) -> RichColor:
    # To Textual `blue` is the web's, not the terminal's own.
    return RichColor.parse(value) if value in ANSI_COLOR_NAMES else Color.parse(value).rich_color
