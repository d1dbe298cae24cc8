"""What a map shows besides the robots that drive now: drawn once for a view and an environment, then kept between frames."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from ddenv.map import arrays as np
from ddenv.map.cells import Cell, place_signs
from ddenv.map.paint import Canvas, readable
from ddenv.map.raster import Outlines, Spans, View, braille, owners, spans
from ddenv.workbench.map.looks import Looks, fill, ghosts
from ddenv.workbench.map.map_colors import REMOVED

Point = tuple[float, float]


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """The models as they lie in a view: the pixels they fill, and their centres in pixels, (N, 2)."""

    view: View
    spans: Spans
    centers: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A path through `points` (N, 2) m in a packed colour; with `dash`, so many dots of it and as many left out in turn."""

    points: np.ndarray
    color: int
    dash: int = 0


@dataclass(frozen=True, slots=True)
class Mark:
    """A letter at a place, m, on a ground of its own, so that it is found at once."""

    point: Point
    text: str
    ground: int


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """A canvas with the owners of its pixels: of kept models in `grid`, of removed ones in `gone`.

    `dotted` cells show removed models, `written` ones bear a letter or a mark. `cells` is where the sign of each model begins
    that has one.
    """

    canvas: Canvas
    grid: np.ndarray
    gone: np.ndarray
    dotted: np.ndarray
    written: np.ndarray
    cells: dict[int, Cell]

    def holds(self, cell: Cell) -> bool:
        """Whether a cell is in the picture."""
        return cell[0] < self.written.shape[0] and cell[1] < self.written.shape[1]

    def owner(self, cell: Cell) -> int:
        """The model that is seen in a cell, a removed one if there are dots, or EMPTY."""
        row, column = cell
        grid = self.gone if self.dotted[cell] else self.grid
        return int(grid[2 * row : 2 * row + 2, column].max())


def seen(outlines: Outlines, view: View) -> Seen:
    """How the models lie in `view`."""
    return Seen(view, spans(outlines, view), view.pixels(outlines.centers))


def picture(
    models: Seen,
    how: Looks,
    *,
    removed: bool,
    lines: Sequence[Line],
    marks: Sequence[Mark],
) -> Picture:
    """All that stays as it is while robots drive. Letters stand on paths, and marks on letters."""
    view = models.view
    canvas = Canvas(view.rows, view.columns, how.palette.back)
    grid = owners(models.spans, view, np.flatnonzero(how.kinds != REMOVED))
    gone = owners(models.spans, view, np.flatnonzero(how.kinds == REMOVED))
    fill(canvas, grid, how)
    dotted = np.zeros(canvas.chars.shape, dtype=bool)
    if removed:
        dotted = ghosts(canvas, gone, grid, how, how.palette.faint)
    for line in lines:
        canvas.dots(braille(line.points, view, line.dash), line.color)
    places = {cell: mark for mark in marks if (cell := view.cell(*mark.point)) is not None}
    written = np.zeros(canvas.chars.shape, dtype=bool)
    cells = place_signs(grid, models.centers, how.signs, places)
    for index, (row, column) in cells.items():
        text, tone = how.labels[index], how.looks[how.tones[index]]
        canvas.put((row, column), text, back=tone.fill)
        written[row, column : column + len(text)] = True
    for cell, mark in places.items():
        canvas.put(cell, mark.text, readable(mark.ground), mark.ground)
        written[cell] = True
    return Picture(canvas, grid, gone, dotted, written, cells)
