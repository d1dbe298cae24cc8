"""Models are told apart by colours, and by fillings and letters where a terminal has few or
none.
"""

import numpy as np
import pytest

from ddenv.map.colors import HUES, PLAIN, luminance, packed
from ddenv.map.footprints import Footprint
from ddenv.map.paint import Canvas
from ddenv.map.raster import View, masks, owners
from ddenv.workbench.map.map_colors import (
    FLOOR,
    KEPT,
    LEFT_OUT,
    OWN,
    PINNED,
    PROTECTED,
    REMOVED,
    SELECTED,
    mixed,
)
from ddenv.workbench.map.model_looks import GONE, Kept, fill, ghosts, looks

DARK, LIGHT = ((15, 20, 27), (213, 219, 229)), ((250, 250, 250), (30, 30, 30))
PALETTES = {"dark": mixed(*DARK), "light": mixed(*LIGHT), "own": mixed(*OWN[True], own=True)}
VIEW = View(x=0, y=0, scale=0.5, columns=20, rows=6)


def squares(count: int, size: float = 1.0) -> list[Footprint]:
    """Boxes beside each other along x, from -5 m on."""
    prints = []
    for number in range(count):
        low, high = (number * size - 5.0, -1.0), ((number + 1) * size - 5.0, 0.5)
        corners = np.array([low, (high[0], low[1]), high, (low[0], high[1])])
        prints.append(Footprint(f"m{number}", (corners,), low, high))
    return prints


def drawn(prints, who, palette):
    how = looks(prints, who, palette)
    canvas = Canvas(VIEW.rows, VIEW.columns, palette.back)
    fill(canvas, owners(masks(prints, VIEW), VIEW), how)
    return canvas, how


def who_of(prints, parts=None, **rest) -> Kept:
    names = frozenset(each.name for each in prints)
    return Kept(elements=names, environment=names, parts=parts or {}, **rest)


@pytest.mark.parametrize("name", PALETTES)
def test_parts_look_different_from_each_other_from_the_background_and_from_what_is_left_out(name):
    palette = PALETTES[name]
    tones = [palette.tone(KEPT, part) for part in range(len(HUES))]
    assert len({tone.fill for tone in tones}) == len(HUES)
    assert (
        tones[0]
        != palette.tone(LEFT_OUT, 0)
        != palette.tone(SELECTED, 0)
        != palette.tone(PINNED, 0)
    )
    for part, tone in enumerate(tones):
        fills = tone.fill, palette.tone(LEFT_OUT, part).fill
        kept, out = (abs(luminance(fill) - luminance(packed(palette.ground))) for fill in fills)
        assert kept > 1.5 * out > 15


def test_kinds_of_models_differ_without_colours_too():
    glyphs = [PALETTES["dark"].tone(kind, 0).glyph for kind in (KEPT, LEFT_OUT, FLOOR, PROTECTED)]
    assert len(set(glyphs)) == 4


@pytest.mark.parametrize("name", PALETTES)
def test_neighbours_of_one_part_have_a_border(name):
    prints = squares(4)
    canvas, _ = drawn(
        prints, who_of(prints, dict.fromkeys(("m0", "m1", "m2", "m3"), 0)), PALETTES[name]
    )
    row = canvas.text(VIEW.rows // 2)
    borders = [column for column, char in enumerate(row) if char == "▉"]
    assert borders == [1, 3, 5]
    # Those of two parts need none.
    canvas, _ = drawn(prints[:2], who_of(prints, {"m0": 0, "m1": 1}), PALETTES[name])
    assert canvas.text(VIEW.rows // 2).strip() == "████"


def test_a_terminals_own_colour_is_never_in_a_block():
    prints = squares(3)
    canvas, _ = drawn(prints, who_of(prints, {"m0": 0, "m1": 1, "m2": 2}), PALETTES["own"])
    blocks = np.isin(canvas.chars, [ord(char) for char in "▀▄█▌▘▖"])
    assert blocks.any() and (canvas.fore[blocks] != PLAIN).all()


@pytest.mark.parametrize("name", PALETTES)
def test_dots_of_removed_models_leave_the_floor_around_them_whole(name):
    palette = PALETTES[name]
    floor = Footprint(
        "floor",
        (np.array([(-5, -1.25), (5, -1.25), (5, 1.25), (-5, 1.25)]),),
        (-5, -1.25),
        (5, 1.25),
    )
    prints = [floor, *squares(3, 0.5)]
    names = frozenset(each.name for each in prints)
    how = looks(prints, Kept(elements=names, environment=frozenset({"floor"})), palette)
    grids = [
        owners(masks(prints, VIEW), VIEW, np.flatnonzero(one))
        for one in (how.kinds == REMOVED, how.kinds == FLOOR)
    ]
    canvas = Canvas(VIEW.rows, VIEW.columns, palette.back)
    fill(canvas, grids[1], how)
    dotted = ghosts(canvas, *grids, how, palette.shade(0.35))
    on_floor = dotted & (np.maximum(grids[1][0::2], grids[1][1::2]) >= 0)
    assert on_floor.any() and (canvas.chars[on_floor] == GONE).all()
    assert set(canvas.back[on_floor].tolist()) == {how.looks[how.tones[0]].fill}


SIGNS = (
    (
        {"parts": {"m0": 0, "m2": 1}, "pinned": frozenset({"m1"}), "selected": frozenset({"m2"})},
        ["A", "+", "*B"],
    ),
    # Numbers of the order of sensing follow the letters.
    ({"parts": {"m0": 0, "m1": 0, "m2": 1}, "sensed": {"m2": 1, "m0": 12}}, ["A12", "A", "B1"]),
    ({"dropped": frozenset({"m1"})}, ["", "↓", ""]),
)


@pytest.mark.parametrize(("who", "signs"), SIGNS)
def test_signs_stand_even_where_space_is_short(who, signs):
    prints = squares(3)
    how = looks(prints, who_of(prints, **who), PALETTES["own"])
    assert list(how.signs.texts) == signs
    assert how.signs.sure.tolist() == [sign[:1] in tuple("+*↓") for sign in signs]
