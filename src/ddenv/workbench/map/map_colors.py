"""The colours and fillings of the map: mixed from the theme's, of which a terminal shows as many as
it has.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from textual.color import Color

from ddenv.map.colors import HUES, PLAIN, RGB, blend, luminance, packed

if TYPE_CHECKING:
    from textual.app import App

KEPT, FLOOR, LEFT_OUT, FLOOR_OUT, PROTECTED, REMOVED, PINNED, SELECTED = range(8)
# A full cell of each kind: where there are colours, all but the protected ones look solid.
SOLID = "█░▓░▒ ██"
# The strength of a part's hue on the background.
STRENGTH = {KEPT: 0.74, FLOOR: 0.24, LEFT_OUT: 0.25, FLOOR_OUT: 0.10, PINNED: 0.62, REMOVED: 0.0}
LIGHT_STRENGTH = STRENGTH | {KEPT: 0.88, LEFT_OUT: 0.30, PINNED: 0.80}
NEUTRAL: RGB = (128, 140, 160)
YELLOW: RGB = (255, 215, 80)
# How much of the text's colour removed models, robots beside the foremost one, and the two paths
# have.
FAINT = 0.35
DULL = 0.5
ORIGINAL = 0.55
PATH = 0.8
# Background and text that a theme of the terminal's own colours may have: it does not say which
# these are.
OWN: dict[bool, tuple[RGB, RGB]] = {
    True: ((15, 20, 27), (213, 219, 229)),
    False: ((246, 248, 251), (28, 35, 45)),
}


@dataclass(frozen=True, slots=True)
class Tone:
    """How a model looks: the `glyph` of a full cell in `ink` on `fill`, and the `seam` between
    neighbours that look alike.
    """

    glyph: str
    fill: int
    ink: int
    seam: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Palette:
    """Packed colours. `back` is the map's background, or PLAIN for the terminal's own; `ground` is
    what is mixed with instead.
    """

    back: int
    ground: RGB
    fore: RGB
    live: int
    start: int
    goal: int
    failure: int

    def shade(self, amount: float) -> int:
        """The text's colour on the background, by this much."""
        return packed(blend(self.ground, self.fore, amount))

    def tone(self, kind: int, part: int) -> Tone:
        """The looks of a model of part number `part`, or of none: -1."""
        if kind == PROTECTED:
            return Tone(SOLID[kind], self.shade(0.1), self.shade(0.2), self.shade(0.1))
        fill = self.live
        if kind != SELECTED:
            hue = NEUTRAL if part < 0 or kind == PINNED else HUES[part % len(HUES)]
            strength = STRENGTH[kind]
            # On a light background a bright hue would not be seen.
            if luminance(packed(self.ground)) > 128:
                hue = blend(hue, (0, 0, 0), 0.4)
                strength = LIGHT_STRENGTH[kind]
            fill = packed(blend(self.ground, hue, strength))
        return Tone(SOLID[kind], fill, fill, packed(blend(unpacked(fill), self.ground, 0.5)))


def unpacked(color: int) -> RGB:
    return color >> 16, color >> 8 & 255, color & 255


def mixed(
    ground: RGB,
    fore: RGB,
    *,
    own: bool = False,
    accent: RGB = YELLOW,
    marks: tuple[RGB, RGB, RGB] | None = None,
) -> Palette:
    """For a background and a text colour; with `own` the background is the terminal's. `marks` are
    those of start, goal and f.
    """
    start, goal, failure = marks or ((31, 111, 235), (26, 127, 55), (207, 34, 46))
    # The accent is moved towards the text's colour if it is too near to the background's.
    moved = (packed(blend(accent, fore, part)) for part in (0.0, 0.25, 0.5))
    live = next(
        (each for each in moved if abs(luminance(each) - luminance(packed(ground))) > 90),
        packed(fore),
    )
    return Palette(
        back=PLAIN if own else packed(ground),
        ground=ground,
        fore=fore,
        live=live,
        start=packed(start),
        goal=packed(goal),
        failure=packed(failure),
    )


def palette_of(app: App[Any], back: Color, fore: Color) -> Palette:
    if app.native_ansi_color:
        return mixed(*OWN[app.current_theme.dark], own=True)
    names = ("accent", "primary", "success", "error")
    accent, *marks = (Color.parse(app.theme_variables[name]).rgb for name in names)
    return mixed(back.rgb, fore.rgb, accent=accent, marks=(marks[0], marks[1], marks[2]))
