"""The colours: two themes of ddenv, Textual's, and the terminal's own colours if it has only
sixteen.
"""

from __future__ import annotations

from collections.abc import Mapping

from rich.color import ANSI_COLOR_NAMES
from rich.color import Color as RichColor
from rich.style import Style
from textual.color import Color, ColorParseError
from textual.theme import BUILTIN_THEMES, Theme

from ddenv.errors import UserError
from ddenv.schemas import nearest

# Calm and dark.
DARK = Theme(
    name="ddenv",
    primary="#6cb6ff",
    secondary="#8b95a7",
    accent="#f2cc60",
    warning="#e3b341",
    error="#ff7b72",
    success="#57c98a",
    foreground="#d5dbe5",
    background="#0f141b",
    surface="#171e28",
    panel="#1c2531",
    dark=True,
    variables={"footer-key-foreground": "#6cb6ff", "primary-muted": "#24476b"},
)
# For daylight: colours are darker, so that they can be read on white.
LIGHT = Theme(
    name="ddenv-light",
    primary="#0a58b0",
    secondary="#55606f",
    accent="#7d5300",
    warning="#7a5000",
    error="#b3261e",
    success="#156b3e",
    foreground="#1c232d",
    background="#f6f8fb",
    surface="#ffffff",
    panel="#e9eef5",
    dark=False,
    variables={
        "footer-key-foreground": "#0a58b0",
        "primary-muted": "#b9d4f3",
        "panel-lighten-2": "#a9b6c8",
        "text-disabled": "auto 55%",
    },
)
# The terminal's own sixteen colours: for terminals that have no more, and for users who prefer
# them.
ANSI = "ansi-dark"
OURS = (DARK, LIGHT)


def theme_names() -> tuple[str, ...]:
    return (*(theme.name for theme in OURS), *sorted(BUILTIN_THEMES))


def theme_called(name: str, where: str) -> str:
    """The theme of this `name`. Raises UserError with a message that begins with `where`."""
    if name in theme_names():
        return name
    raise UserError(
        f"{where}: there is no theme '{name}'{nearest(name, theme_names())}; 'ddenv config' "
        "lists them"
    )


def fitting(color_system: str | None) -> str:
    # Colours of ddenv's themes would become the nearest of sixteen, and some the same.
    if color_system == "standard":
        return ANSI
    return DARK.name


def for_rich(variables: Mapping[str, str]) -> dict[str, str]:
    """A theme's variables, with Rich's names for the terminal's own colours: not ansi_red 50% but
    red.
    """
    ansi = {
        key: value.split()[0].removeprefix("ansi_")
        for key, value in variables.items()
        if value.startswith("ansi_")
    }
    return {
        **variables,
        **ansi,
        **{key: "default" for key, value in variables.items() if value == "transparent"},
    }


def ink(variables: Mapping[str, str], name: str, *, bold: bool = False) -> Style:
    """The theme's colour `name` as the colour of text; without colour if the theme leaves it to the
    terminal.
    """
    try:
        value = variables[name]
        # In Textual `blue` is the web's colour, not the terminal's.
        if value in ANSI_COLOR_NAMES:
            color = RichColor.parse(value)
        else:
            color = Color.parse(value).rich_color
    except (KeyError, ColorParseError):
        color = None
    return Style(color=color, bold=bold or None)
