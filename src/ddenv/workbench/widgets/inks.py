"""The theme's colours as styles of text."""

from __future__ import annotations

from collections.abc import Mapping

from rich.style import Style
from textual.color import Color, ColorParseError


def ink(variables: Mapping[str, str], name: str, *, bold: bool = False) -> Style:
    """The theme's colour `name` as the colour of text; without colour where the theme leaves it to the terminal."""
    try:
        return Style(color=Color.parse(variables[name]).rich_color, bold=bold or None)
    except (KeyError, ColorParseError):
        return Style(bold=bold or None)
