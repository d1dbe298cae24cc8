"""Models are told apart with many colours, with sixteen and with none."""

from types import SimpleNamespace

import numpy as np
import pytest
from rich.color import Color as Shade
from rich.color import ColorSystem
from textual.color import Color

from ddenv.map.colors import HUES, NUMBERED, luminance, packed
from ddenv.map.footprints import Footprint
from ddenv.map.paint import Canvas
from ddenv.map.raster import View, masks, owners
from ddenv.workbench.map.map_colors import (
    FLOOR,
    KEPT,
    LEFT_OUT,
    MANY,
    NONE,
    NUMBERS,
    PINNED,
    REMOVED,
    SELECTED,
    SIXTEEN,
    mixed,
    palette_of,
    plain,
    sixteen,
)
from ddenv.workbench.map.model_looks import GONE, Kept, fill, ghosts, looks
from ddenv.workbench.map.picture import strip

DARK, LIGHT = ((15, 20, 27), (213, 219, 229)), ((250, 250, 250), (30, 30, 30))
PALETTES = {
    "many": mixed(*DARK),
    "light": mixed(*LIGHT),
    "sixteen": sixteen(packed(DARK[0]), packed(DARK[1])),
    "numbered": sixteen(),
    "none": plain(packed(DARK[0]), packed(DARK[1])),
    "nothing": plain(),
}
VIEW = View(0, 0, 0.5, 20, 6)


def squares(count: int, size: float = 1.0) -> list[Footprint]:
    """Boxes beside each other along x, from -5 m on."""
    prints = []
    for number in range(count):
        low, high = (number * size - 5.0, -1.0), ((number + 1) * size - 5.0, 0.5)
        corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
        prints.append(Footprint(f"m{number}", (corners,), low, high))
    return prints


def drawn(prints, who, palette):
    how = looks(prints, who, (0, 0, 0), (0, 0, 0), palette)
    canvas = Canvas(VIEW.rows, VIEW.columns, palette.back)
    fill(canvas, owners(masks(prints, VIEW), VIEW), how)
    return canvas, how


def who_of(prints, parts=None, **rest) -> Kept:
    names = frozenset(each.name for each in prints)
    return Kept(names, names, parts=parts or {}, **rest)


@pytest.mark.parametrize("name", PALETTES)
def test_parts_look_different_from_each_other_and_from_what_is_left_out(name):
    palette = PALETTES[name]
    count = palette.tones
    assert count == {MANY: 8, SIXTEEN: 6, NONE: 6}[palette.colors]
    tones = [palette.tone(KEPT, part) for part in range(count)]
    assert len({(tone.glyph, tone.fill, tone.ink) for tone in tones}) == count
    assert tones[0] != palette.tone(LEFT_OUT, 0) != palette.tone(SELECTED, 0) != palette.tone(PINNED, 0)


def test_sixteen_colours_stay_different_when_a_terminal_has_no_more():
    hues = [PALETTES["sixteen"].tone(KEPT, part).fill for part in range(6)]
    shown = [Shade.from_rgb(*hue.to_bytes(3, "big")).downgrade(ColorSystem.STANDARD).number for hue in hues]
    assert shown == list(NUMBERS)
    assert [PALETTES["numbered"].tone(KEPT, part).fill - NUMBERED for part in range(6)] == list(NUMBERS)


@pytest.mark.parametrize("name", ["many", "light"])
def test_kept_models_stand_out_from_the_background_and_from_what_is_left_out(name):
    palette = PALETTES[name]
    for part in range(len(HUES)):
        kept, out = (
            abs(luminance(palette.tone(kind, part).fill) - luminance(palette.back)) for kind in (KEPT, LEFT_OUT)
        )
        assert kept > 1.5 * out > 15


@pytest.mark.parametrize("name", PALETTES)
def test_neighbours_of_one_part_have_a_border(name):
    prints = squares(4)
    canvas, _ = drawn(prints, who_of(prints, dict.fromkeys(("m0", "m1", "m2", "m3"), 0)), PALETTES[name])
    row = canvas.text(VIEW.rows // 2)
    borders = [column for column, char in enumerate(row) if char in "▉▌"]
    assert borders == [1, 3, 5]


@pytest.mark.parametrize(("name", "part"), [("none", 1), ("nothing", 7)])
def test_neighbours_of_one_patterned_part_too(name, part):
    prints = squares(3)
    canvas, _ = drawn(prints, who_of(prints, dict.fromkeys(("m0", "m1", "m2"), part)), PALETTES[name])
    assert canvas.text(VIEW.rows // 2)[:6] == "╱▕╱▕╱╱"


def test_neighbours_of_two_parts_need_none():
    prints = squares(2)
    canvas, _ = drawn(prints, who_of(prints, {"m0": 0, "m1": 1}), PALETTES["many"])
    assert canvas.text(VIEW.rows // 2).strip() == "████"


def test_a_terminals_own_colour_is_never_in_a_block():
    prints = squares(3)
    canvas, _ = drawn(prints, who_of(prints, {"m0": 0, "m1": 1, "m2": 2}), PALETTES["numbered"])
    blocks = np.isin(canvas.chars, [ord(char) for char in "▀▄█▌▘▖"])
    assert blocks.any()
    assert (canvas.fore[blocks] >= NUMBERED).all()
    assert strip(canvas, VIEW.rows // 2)._segments[0].style.color.number == NUMBERS[0]


@pytest.mark.parametrize("name", ["many", "light", "sixteen"])
def test_dots_of_removed_models_leave_the_floor_around_them_whole(name):
    palette = PALETTES[name]
    floor = Footprint("floor", (np.array([(-5, -1.25), (5, -1.25), (5, 1.25), (-5, 1.25)]),), (-5, -1.25), (5, 1.25))
    prints = [floor, *squares(3, 0.5)]
    names = frozenset(each.name for each in prints)
    how = looks(prints, Kept(names, frozenset({"floor"})), (0, 0, 0), (0, 0, 0), palette)
    grids = [
        owners(masks(prints, VIEW), VIEW, np.flatnonzero(one)) for one in (how.kinds == REMOVED, how.kinds == FLOOR)
    ]
    canvas = Canvas(VIEW.rows, VIEW.columns, palette.back)
    fill(canvas, grids[1], how)
    dotted = ghosts(canvas, *grids, how, palette.faint)
    on_floor = dotted & (np.maximum(grids[1][0::2], grids[1][1::2]) >= 0)
    assert on_floor.any() and (canvas.chars[on_floor] == GONE).all()
    assert set(canvas.back[on_floor].tolist()) == {how.looks[how.tones[0]].fill}


def test_pinned_and_selected_models_have_signs_of_their_own():
    prints = squares(3)
    who = who_of(prints, {"m0": 0, "m2": 1}, pinned=frozenset({"m1"}), selected=frozenset({"m2"}))
    _, how = drawn(prints, who, PALETTES["none"])
    assert list(how.labels) == ["A", "+", "*B"]
    assert how.kinds.tolist() == [KEPT, PINNED, SELECTED]
    assert how.signs.sure.tolist() == [False, True, True]


def test_numbers_of_the_order_of_sensing_follow_the_letters():
    prints = squares(3)
    _, how = drawn(prints, who_of(prints, {"m0": 0, "m1": 0, "m2": 1}, sensed={"m2": 1, "m0": 12}), PALETTES["many"])
    assert list(how.labels) == ["A12", "A", "B1"]


def app_of(system="truecolor", **rest):
    about = {"native_ansi_color": False, "is_headless": False, "no_color": False, "theme_variables": {}} | rest
    return SimpleNamespace(console=SimpleNamespace(color_system=system), **about)


@pytest.mark.parametrize(
    ("app", "colors"),
    [
        (app_of(), MANY),
        (app_of("256"), MANY),
        (app_of("standard"), SIXTEEN),
        (app_of(native_ansi_color=True), SIXTEEN),
        (app_of(None), NONE),
        (app_of(no_color=True), NONE),
        (app_of(None, is_headless=True), MANY),
    ],
)
def test_the_palette_is_what_the_terminal_can_show(app, colors):
    palette = palette_of(app, Color(15, 20, 27), Color(213, 219, 229))
    assert palette.colors == colors
    assert palette.native == app.native_ansi_color


def test_what_drops_is_marked_even_where_space_is_short():
    prints = squares(3)
    how = looks(prints, who_of(prints, dropped=frozenset({"m1"})), *DARK)
    assert [text.startswith("↓") for text in how.labels] == [False, True, False]
    assert how.signs.sure.tolist() == [False, True, False]
