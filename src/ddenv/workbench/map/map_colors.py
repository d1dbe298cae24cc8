"""The colours and fillings of the map: for many colours, for the sixteen of a terminal, and for none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from textual.color import Color, ColorParseError

from ddenv.map.colors import HUES, NUMBERED, PLAIN, RGB, blend, luminance, packed

if TYPE_CHECKING:
    from textual.app import App

KEPT, FLOOR, LEFT_OUT, FLOOR_OUT, PROTECTED, REMOVED, PINNED, SELECTED = range(8)
# The number of colours of the terminal.
MANY, SIXTEEN, NONE = 24, 4, 0
# A full cell of each kind. Where there are many colours, all but the protected ones look solid.
SOLID = "█░▓░▒ ██"
# A full cell of parts 1, 2, ... where there are no colours to tell them apart.
PATTERNS = "█╱─╲│╳"
# The strength of a part's hue on the background.
STRENGTH = {KEPT: 0.74, FLOOR: 0.24, LEFT_OUT: 0.25, FLOOR_OUT: 0.10, PINNED: 0.62, REMOVED: 0.0}
LIGHT_STRENGTH = STRENGTH | {KEPT: 0.88, LEFT_OUT: 0.30, PINNED: 0.80}
# Bright blue, yellow, green, magenta, red and cyan of the sixteen: as numbers, and as the colours that terminals show.
NUMBERS = (12, 3, 2, 5, 1, 6)
STANDARD: tuple[int, ...] = (0x5555FF, 0xAA5500, 0x00AA00, 0xAA00AA, 0xAA0000, 0x00AAAA)
NEUTRAL: RGB = (128, 140, 160)


@dataclass(frozen=True, slots=True)
class Tone:
    """How a model looks: the `glyph` of a full cell in `ink` on `fill`. With `halves`, half a cell can be filled with `fill`.

    A `seam` of that colour is drawn between neighbours that look alike; PLAIN's is the terminal's own.
    """

    glyph: str
    fill: int
    ink: int
    seam: int
    halves: bool = True


@dataclass(frozen=True, slots=True)
class Palette:
    """Packed colours. `back` and `fore` are background and text, `native` says that the sixteen colours are numbers."""

    colors: int
    back: int
    fore: int
    faint: int
    path: int
    original: int
    live: int
    dull: int
    selected: int
    start: int
    goal: int
    failure: int
    native: bool = False

    @property
    def tones(self) -> int:
        """The number of parts with different looks."""
        return {MANY: len(HUES), SIXTEEN: len(NUMBERS), NONE: len(PATTERNS)}[self.colors]

    def tone(self, kind: int, part: int) -> Tone:
        """The looks of a model of part number `part`, or of none: -1."""
        if self.colors == MANY:
            return self._rich(kind, part)
        return self._sparse(kind, part)

    def _rich(self, kind: int, part: int) -> Tone:
        back = unpacked(self.back)
        if kind == PROTECTED:
            fill = packed(blend(back, unpacked(self.fore), 0.10))
            return Tone(SOLID[kind], fill, packed(blend(back, unpacked(self.fore), 0.20)), fill)
        if kind == SELECTED:
            return Tone(SOLID[kind], self.selected, self.selected, self._seam(self.selected))
        hue = NEUTRAL if part < 0 or kind == PINNED else HUES[part % len(HUES)]
        strength = STRENGTH[kind]
        # On a light background a bright hue would not be seen.
        if luminance(self.back) > 128:
            hue, strength = blend(hue, (0, 0, 0), 0.4), LIGHT_STRENGTH[kind]
        fill = packed(blend(back, hue, strength))
        return Tone(SOLID[kind], fill, fill, self._seam(fill))

    def _seam(self, fill: int) -> int:
        return packed(blend(unpacked(fill), unpacked(self.back), 0.5))

    def _sparse(self, kind: int, part: int) -> Tone:
        """For few colours or none: dots of one colour replace a weaker one."""
        color = self._color(part)
        if kind == REMOVED:
            return Tone(" ", self.back, self.back, self.back)
        if kind == SELECTED:
            return Tone("█", self.selected, self.selected, self.back, self.colors != NONE)
        if kind == PINNED:
            return Tone("▓", self.back, self.fore, self.back, False)
        if kind == PROTECTED:
            return Tone("░", self.back, self.faint, self.back, False)
        if kind == FLOOR_OUT:
            return Tone(" ", self.back, self.back, self.back, False)
        if kind == FLOOR:
            return Tone(":", self.back, color, self.back, False)
        if kind == LEFT_OUT:
            return Tone("▒", self.back, color, self.back, False)
        pattern = PATTERNS[max(part, 0) % len(PATTERNS)] if self.colors == NONE else "█"
        if pattern == "█":
            return Tone(pattern, color, color, self.back)
        return Tone(pattern, self.back, color, self.back, False)

    def _color(self, part: int) -> int:
        if self.colors == NONE or part < 0:
            return self.fore
        return NUMBERED | NUMBERS[part % len(NUMBERS)] if self.native else STANDARD[part % len(STANDARD)]


def unpacked(color: int) -> RGB:
    return color >> 16, color >> 8 & 255, color & 255


def mixed(back: RGB, fore: RGB, *, accent: RGB = (255, 215, 80), marks: tuple[RGB, RGB, RGB] | None = None) -> Palette:
    """For a terminal with many colours. `marks` are those of start, goal and f."""
    ground, text = packed(back), packed(fore)
    accent = _seen(accent, back, fore)
    start, goal, failure = marks or ((31, 111, 235), (26, 127, 55), (207, 34, 46))
    return Palette(
        MANY,
        back=ground,
        fore=text,
        faint=packed(blend(back, fore, 0.35)),
        path=packed(blend(back, fore, 0.80)),
        original=packed(blend(back, fore, 0.55)),
        live=packed(accent),
        dull=packed(blend(back, fore, 0.5)),
        selected=packed(accent),
        start=packed(start),
        goal=packed(goal),
        failure=packed(failure),
    )


def _seen(color: RGB, back: RGB, fore: RGB) -> RGB:
    """`color`, moved towards the text's if it is too near to the background's."""
    for part in (0.0, 0.25, 0.5):
        found = blend(color, fore, part)
        if abs(luminance(packed(found)) - luminance(packed(back))) > 90:
            return found
    return fore


def sixteen(back: int = PLAIN, fore: int = PLAIN) -> Palette:
    """For the colours that every terminal has; without a background it is the terminal's own, as in an ANSI theme."""
    native = back == PLAIN
    if native:
        grey, cyan, yellow, white = (NUMBERED | number for number in (8, 6, 3, 15))
    else:
        grey, cyan, yellow, white = 0x555555, 0x00AAAA, 0xAA5500, 0xFFFFFF
    # With their own hues, start, goal and f would look like models of a part.
    marks = dict.fromkeys(("start", "goal", "failure"), white)
    lines = {"path": fore, "original": cyan, "live": yellow, "dull": fore}
    return Palette(SIXTEEN, back, fore, faint=grey, selected=fore, native=native, **lines, **marks)


def plain(back: int = PLAIN, fore: int = PLAIN) -> Palette:
    """For a terminal without colours: letters and fillings show everything."""
    native = back == PLAIN
    faint = fore if native else packed(blend(unpacked(back), unpacked(fore), 0.4))
    names = ("path", "original", "live", "dull", "selected", "start", "goal", "failure")
    return Palette(NONE, back, fore, faint, native=native, **dict.fromkeys(names, fore))


def palette_of(app: App[Any], back: Color, fore: Color) -> Palette:
    """The palette for a widget's background and text colour in the app's theme and terminal."""
    native = app.native_ansi_color
    ground, text = (PLAIN, PLAIN) if native else (packed(back.rgb), packed(fore.rgb))
    system = "truecolor" if app.is_headless else app.console.color_system
    if app.no_color or system is None:
        return plain(ground, text)
    if native or system in ("standard", "windows"):
        return sixteen(ground, text)
    start, goal, failure = _variable(app, "primary"), _variable(app, "success"), _variable(app, "error")
    marks = (start, goal, failure) if start and goal and failure else None
    return mixed(back.rgb, fore.rgb, accent=_variable(app, "accent") or (255, 215, 80), marks=marks)


def _variable(app: App[Any], name: str) -> RGB | None:
    """A colour of the theme, if it is one."""
    try:
        return Color.parse(app.theme_variables.get(name, "")).rgb
    except ColorParseError:
        return None
