"""The models of a world as character cells: half blocks in colour, or one letter per model without
colours.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ddenv.map.colors import PLAIN, RGB, blend, packed, readable
from ddenv.map.paint import Canvas
from ddenv.map.raster import EMPTY, View, label_cells, masks, owners

if TYPE_CHECKING:
    from ddenv.map.footprints import Drawn

Cell = tuple[int, int]
ROOM = 20  # cells for each letter, so that the map stays readable
# One per model, the largest first: without S and G, which mark start and goal, and without
# look-alikes.
SIGNS = "ABCDEFHJKLMNPQRTUVWXYZabcdefghijkmnopqrstuvwxyz23456789"
NO_SIGN = "+"
FLOORS = ".:"
FAINT_SIGN = "░"
HALF_TOP = "▀"
HALF_BOTTOM = "▄"
FULL = "█"
GREY: RGB = (120, 120, 124)
SHADE: RGB = (70, 70, 74)
FAINT = packed(GREY)
DIM = packed(SHADE)
# Limits of brightness (mean of red, green and blue, 0..255) for visibility on all terminals.
DARKEST = 60.0
BRIGHTEST = 225.0


@dataclass(frozen=True, slots=True, eq=False)
class Signs:
    """The signs of N models: `texts`, "" for none. At least one sign of each of the `groups` (N,)
    should be visible.

    Signs with a lower `rank` (N,) come first; those marked `sure` (N,) are kept even if space is
    short.
    """

    texts: Sequence[str]
    groups: np.ndarray
    rank: np.ndarray
    sure: np.ndarray


def place_signs(
    grid: np.ndarray, centers: np.ndarray, signs: Signs, taken: Collection[Cell] = ()
) -> dict[int, Cell]:
    """The cell where the sign of each model begins, for as many models as stay readable; no two
    signs overlap.

    `grid` (2 rows, columns) holds the owners of pixels, `centers` (N, 2) are in pixels; `taken`
    cells stay free.
    """
    rows = grid.shape[0] // 2
    columns = grid.shape[1]
    cells = label_cells(grid, centers)
    named = np.array([bool(text) for text in signs.texts], dtype=bool)
    seen = np.flatnonzero((cells[:, 0] >= 0) & named)
    sizes = np.bincount(grid[grid >= 0], minlength=len(centers))
    seen = seen[np.lexsort((-sizes[seen], signs.rank[seen], ~signs.sure[seen]))]
    # The sure ones, the first of each group, and as many more as stay readable.
    kept: np.ndarray = signs.sure[seen] | (np.arange(len(seen)) < rows * columns // ROOM)
    kept[np.unique(signs.groups[seen], return_index=True)[1]] = True
    seen = seen[kept]
    occupied = set(taken)
    placed = dict[int, Cell]()

    def put(index: int, row: int, column: int) -> bool:
        """Puts the sign of a model there if all its cells are free. Returns whether they are."""
        length = len(signs.texts[index])
        column = max(0, min(column, columns - length))
        own = [(row, column + offset) for offset in range(length)]
        if not occupied.isdisjoint(own):
            return False
        occupied.update(own)
        placed[index] = row, column
        return True

    missing = [
        index
        for index, cell in zip(seen.tolist(), cells[seen].tolist(), strict=True)
        if not put(index, *cell)
    ]
    groups = {int(signs.groups[index]) for index in placed}
    for index in missing:
        group = int(signs.groups[index])
        if group in groups and not signs.sure[index]:
            continue
        if any(put(index, *cell) for cell in _around(grid, index, len(signs.texts[index]))):
            groups.add(group)
    return placed


def _around(grid: np.ndarray, index: int, length: int) -> list[Cell]:
    """All cells of a model, then those beside it where a sign of this length may begin."""
    rows, columns = np.nonzero((grid[0::2] == index) | (grid[1::2] == index))
    cells = list(zip(rows.tolist(), columns.tolist(), strict=True))
    beside = ((row, column + step) for row, column in cells for step in (1, -1, -length))
    return [*cells, *(cell for cell in beside if 0 <= cell[1] < grid.shape[1])]


def signs(models: Sequence[Drawn]) -> list[str]:
    """The letter or digit of each model, or "" once they run out."""
    largest = sorted(range(len(models)), key=lambda index: -models[index].outline.area)
    found = [""] * len(models)
    for index, sign in zip(largest, SIGNS, strict=False):
        found[index] = sign
    return found


def picture(
    models: Sequence[Drawn], view: View, *, color: bool, dim: Collection[str] = ()
) -> Canvas:
    """All models in `view`, each with its sign; those that are `dim` have none. `PLAIN` is the
    terminal's own colour.
    """
    canvas = Canvas(view.rows, view.columns, GREY)
    canvas.fore[:] = PLAIN
    canvas.back[:] = PLAIN
    outlines = [each.outline for each in models]
    grid = owners(masks(outlines, view), view)
    faint = [each.model.name in dim for each in models]
    fills = [DIM if faint[index] else _fill(each, index) for index, each in enumerate(models)]
    letters = ["" if faint[index] else sign for index, sign in enumerate(signs(models))]
    if color:
        _blocks(canvas, grid, fills)
    else:
        _letters(canvas, grid, models, letters, faint)
    centers = view.pixels(np.array([each.outline.center for each in models]).reshape(-1, 2))
    for (row, column), sign, fill in zip(
        label_cells(grid, centers).tolist(), letters, fills, strict=True
    ):
        if row >= 0 and sign:
            if color:
                canvas.put((row, column), sign, readable(fill), fill)
            else:
                canvas.put((row, column), sign, PLAIN, None)
    return canvas


def _fill(each: Drawn, index: int) -> int:
    """Floors are dark and greyish, and models drawn one after the other differ."""
    if each.floor:
        return packed(_visible(blend(each.color, SHADE, 0.7)))
    return packed(_visible(blend(each.color, (0, 0, 0), 0.14 * (index % 2))))


def _visible(color: RGB) -> RGB:
    mean = sum(color) / 3
    if mean < DARKEST:
        return blend(color, (255, 255, 255), (DARKEST - mean) / (255 - mean))
    if mean > BRIGHTEST:
        return blend(color, (0, 0, 0), 1 - BRIGHTEST / mean)
    return color


def _blocks(canvas: Canvas, grid: np.ndarray, fills: Sequence[int]) -> None:
    """Two pixels per cell; the terminal's own colour can only be the background of a block."""
    assert EMPTY == -1
    colors = np.array([*fills, PLAIN], dtype=np.int32)
    top = colors[grid[0::2]]
    bottom = colors[grid[1::2]]
    upper = top != PLAIN
    lower = bottom != PLAIN
    canvas.chars[upper] = ord(HALF_TOP)
    canvas.fore[upper] = top[upper]
    canvas.back[upper] = bottom[upper]
    canvas.chars[~upper & lower] = ord(HALF_BOTTOM)
    canvas.fore[~upper & lower] = bottom[~upper & lower]
    same = upper & (top == bottom)
    canvas.chars[same] = ord(FULL)
    canvas.back[same] = PLAIN


def _letters(
    canvas: Canvas,
    grid: np.ndarray,
    models: Sequence[Drawn],
    letters: Sequence[str],
    faint: Sequence[bool],
) -> None:
    """Every cell shows its model; of two models in one cell the one drawn later."""
    plain = (
        FLOORS[index % 2] if each.floor else letters[index] or NO_SIGN
        for index, each in enumerate(models)
    )
    own = [FAINT_SIGN if is_faint else char for char, is_faint in zip(plain, faint, strict=True)]
    chars = np.array([ord(char) for char in [*own, " "]], dtype=np.uint32)
    canvas.chars[:] = chars[np.maximum(grid[0::2], grid[1::2])]
