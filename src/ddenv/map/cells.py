"""The models of a world as cells of characters: half blocks of colour, or a letter for each model where there are no colours."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ddenv.map.paint import PLAIN, RGB, Canvas, blend, packed, readable
from ddenv.map.plan import Drawn
from ddenv.map.raster import EMPTY, View, label_cells, masks, owners

# One for each model, the largest first: no S and G, which mark start and goal, and none that looks like another one.
SIGNS = "ABCDEFHJKLMNPQRTUVWXYZabcdefghijkmnopqrstuvwxyz23456789"
NO_SIGN, FLOORS = "+", ".:"
HALF_TOP, HALF_BOTTOM, FULL = "▀", "▄", "█"
GREY: RGB = (120, 120, 124)
FAINT = packed(GREY)
# Anything darker or brighter could not be seen on some terminal; mean of red, green and blue.
DARKEST, BRIGHTEST = 60.0, 225.0


def signs(models: Sequence[Drawn]) -> list[str]:
    """The letter or digit of each model, or "" where they run out."""
    largest = sorted(range(len(models)), key=lambda index: -models[index].outline.area)
    found = [""] * len(models)
    for index, sign in zip(largest, SIGNS, strict=False):
        found[index] = sign
    return found


def picture(models: Sequence[Drawn], view: View, *, color: bool) -> Canvas:
    """All models as seen in `view`, each with its sign. `PLAIN` in the canvas is the terminal's own colour."""
    canvas = Canvas(view.rows, view.columns, GREY)
    canvas.fore[:], canvas.back[:] = PLAIN, PLAIN
    outlines = [each.outline for each in models]
    grid = owners(masks(outlines, view), view)
    fills = [_fill(each, index) for index, each in enumerate(models)]
    letters = signs(models)
    if color:
        _blocks(canvas, grid, fills)
    else:
        _letters(canvas, grid, models, letters)
    centers = view.pixels(np.array([each.outline.center for each in models]).reshape(-1, 2))
    for (row, column), sign, fill in zip(label_cells(grid, centers).tolist(), letters, fills, strict=True):
        if row >= 0 and sign:
            canvas.put((row, column), sign, readable(fill) if color else PLAIN, fill if color else None)
    return canvas


def _fill(each: Drawn, index: int) -> int:
    """Floors are dull; what is low is darker than what is high, and neighbours in the order of drawing differ."""
    if each.floor:
        return packed(_visible(blend(each.color, GREY, 0.6)))
    dark = 0.15 * (1 - each.shade) + 0.14 * (index % 2)
    return packed(_visible(blend(each.color, (0, 0, 0), dark)))


def _visible(color: RGB) -> RGB:
    mean = sum(color) / 3
    if mean < DARKEST:
        return blend(color, (255, 255, 255), (DARKEST - mean) / (255 - mean))
    if mean > BRIGHTEST:
        return blend(color, (0, 0, 0), 1 - BRIGHTEST / mean)
    return color


def _blocks(canvas: Canvas, grid: np.ndarray, fills: Sequence[int]) -> None:
    """Two pixels a cell; the terminal's own colour can only be behind a block, never in it."""
    assert EMPTY == -1
    colors = np.array([*fills, PLAIN], dtype=np.int32)
    top, bottom = colors[grid[0::2]], colors[grid[1::2]]
    upper, lower = top != PLAIN, bottom != PLAIN
    canvas.chars[upper] = ord(HALF_TOP)
    canvas.fore[upper], canvas.back[upper] = top[upper], bottom[upper]
    canvas.chars[~upper & lower] = ord(HALF_BOTTOM)
    canvas.fore[~upper & lower] = bottom[~upper & lower]
    same = upper & (top == bottom)
    canvas.chars[same], canvas.back[same] = ord(FULL), PLAIN


def _letters(canvas: Canvas, grid: np.ndarray, models: Sequence[Drawn], letters: Sequence[str]) -> None:
    """Every cell shows whose it is; of two models in one cell the one that is drawn later."""
    own = [FLOORS[index % 2] if each.floor else letters[index] or NO_SIGN for index, each in enumerate(models)]
    chars = np.array([ord(char) for char in [*own, " "]], dtype=np.uint32)
    canvas.chars[:] = chars[np.maximum(grid[0::2], grid[1::2])]
