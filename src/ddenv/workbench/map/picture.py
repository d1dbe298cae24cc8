"""The picture of a map: the background, then the robots, their paths, and the crosshair."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np
from rich.color import Color
from rich.segment import Segment
from rich.style import Style
from textual.strip import Strip

from ddenv.map.cells import Cell, place_signs
from ddenv.map.colors import readable
from ddenv.map.paint import Canvas
from ddenv.map.raster import ARROWS, EMPTY, HOLLOW, Outlines, Spans, View, arrow, braille, owners, spans
from ddenv.runfile.store import Live
from ddenv.text import plain, shortened
from ddenv.workbench.map.map_colors import REMOVED, Palette
from ddenv.workbench.map.model_looks import Looks, fill, ghosts
from ddenv.workbench.map.place import Point, Way
from ddenv.workbench.shared.poll import Snapshot
from ddenv.world.pose import heading

if TYPE_CHECKING:
    from ddenv.map.footprints import Footprint

# Maximum width of a model's name, in cells.
NAME = 20
ARMS = (((0, -1), "─"), ((0, 1), "─"), ((-1, 0), "│"), ((1, 0), "│"))


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """The models as they lie in a view: the pixels they fill, and their centres in pixels, (N, 2)."""

    view: View
    spans: Spans
    centers: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Line:
    """A path through `points` (N, 2) m in a packed colour; with `dash`, this number of dots and of gaps in turn."""

    points: np.ndarray
    color: int
    dash: int = 0


@dataclass(frozen=True, slots=True)
class Mark:
    """A letter at a place, m, with its own background, so that it is easy to find."""

    point: Point
    text: str
    ground: int


@dataclass(frozen=True, slots=True, eq=False)
class Picture:
    """A canvas for `view`, with the looks of the models and the owner of each pixel: kept ones in `grid`, removed ones in `gone`.

    `dotted` cells show removed models, `written` ones bear a letter or a mark. `cells` is where each model's sign begins, if it
    has one.
    """

    view: View
    how: Looks
    canvas: Canvas
    grid: np.ndarray
    gone: np.ndarray
    dotted: np.ndarray
    written: np.ndarray
    cells: dict[int, Cell]

    def holds(self, cell: Cell) -> bool:
        """Whether a cell is in the picture."""
        rows, columns = self.canvas.chars.shape
        return cell[0] < int(rows) and cell[1] < int(columns)

    def owner(self, cell: Cell) -> int | None:
        """The number of the model that is seen in a cell, a removed one if there are dots; None if there is none."""
        row, column = cell
        grid = self.gone if self.dotted[cell] else self.grid
        owner = int(grid[2 * row : 2 * row + 2, column].max())
        return None if owner == EMPTY else owner


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
    """All that does not change while robots drive. Letters cover paths, and marks cover letters."""
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
    return Picture(view, how, canvas, grid, gone, dotted, written, cells)


def names(drawn: Picture, prints: Sequence[Footprint], near: Point | None) -> None:
    """Writes the names of kept models beside their signs: the nearest to the place `near` first, then the largest; none overlap."""
    canvas, written, view = drawn.canvas, drawn.written, drawn.view
    kept = np.flatnonzero(drawn.how.kinds != REMOVED).tolist()
    away = {index: round(prints[index].distance(near), 1) if near else 0.0 for index in kept}
    for index in sorted(kept, key=lambda index: (away[index], -prints[index].area)):
        at = drawn.cells.get(index) or view.cell(*prints[index].center)
        if at is None:
            continue
        text, sign = (
            shortened(plain(prints[index].name), NAME),
            len(drawn.how.labels[index]) if index in drawn.cells else 0,
        )
        begins = ((0, sign + 1), (0, -len(text) - 1), (-1, 0), (1, 0)) if sign else ((0, 0), (-1, 0), (1, 0))
        for down, right in begins:
            row, column = at[0] + down, at[1] + right
            if not (0 <= row < view.rows and 0 <= column <= view.columns - len(text)):
                continue
            # With a free cell on each side names stay apart.
            if not written[row, max(0, column - (right != sign + 1)) : column + len(text) + 1].any():
                canvas.put((row, column), text)
                written[row, column : column + len(text)] = True
                break


def follow(trails: Mapping[int, list[Point]], snapshot: Snapshot) -> dict[int, list[Point]]:
    """The paths of the robots that drive now, by test, m: the earlier ones with the current places."""
    grown = {}
    for live in snapshot.live:
        trail = trails.get(live.test, [])
        point = (live.pose[0], live.pose[1])
        if not trail or trail[-1] != point:
            trail.append(point)
        grown[live.test] = trail
    return grown


def _in_focus(snapshot: Snapshot) -> frozenset[int]:
    """The running tests of the candidate in focus."""
    focus = snapshot.focus
    return frozenset(test.id for test in snapshot.running if focus is not None and test.candidate == focus.index)


def foremost(snapshot: Snapshot) -> Live | None:
    """The running test that stands out: one of the candidate in focus, if there is one."""
    ids = _in_focus(snapshot)
    return next((live for live in snapshot.live if live.test in ids), next(iter(snapshot.live), None))


def robots(
    canvas: Canvas,
    view: View,
    written: np.ndarray,
    snapshot: Snapshot,
    trails: Mapping[int, list[Point]],
    palette: Palette,
) -> None:
    """The robots as arrows with their paths, which hide no letter; those of the candidate in focus stand out."""
    ids = _in_focus(snapshot)
    colors = {live.test: palette.live if live.test in ids or not ids else palette.dull for live in snapshot.live}
    for test, trail in trails.items():
        bits = braille(np.array(trail), view)
        bits[written] = 0
        canvas.dots(bits, colors.get(test, palette.dull))
    for live in snapshot.live:
        color = colors[live.test]
        canvas.put(view.cell(live.pose[0], live.pose[1]), arrow(heading(live.pose[3:])), readable(color), color)


def riders(canvas: Canvas, view: View, written: np.ndarray, ways: Sequence[Way], palette: Palette, dash: int) -> None:
    """The robots on one or two ways, the first one as an arrow, the second one below it as a hollow arrow; behind each its path."""
    both = list(zip(ways, (palette.live, palette.dull), (ARROWS, HOLLOW), (0, dash), strict=False))
    for way, color, _, gap in reversed(both):
        bits = braille(way.points[: way.gone], view, gap)
        bits[written] = 0
        canvas.dots(bits, color)
    for way, color, signs, _ in reversed(both):
        if way.robot is not None:
            x, y, yaw = way.robot
            canvas.put(view.cell(x, y), arrow(yaw, signs), readable(color), color)


def crosshair(canvas: Canvas, cell: Cell, written: np.ndarray, palette: Palette) -> None:
    """Marks a cell by four arms; a letter in it stays readable."""
    rows, columns = canvas.chars.shape
    row, column = min(cell[0], rows - 1), min(cell[1], columns - 1)
    for (down, right), sign in ARMS:
        place = row + down, column + right
        if 0 <= place[0] < rows and 0 <= place[1] < columns:
            canvas.put(place, sign)
    sign = chr(canvas.chars[row, column]) if written[row, column] else "┼"
    canvas.put((row, column), sign, readable(palette.live), palette.live)


def strip(canvas: Canvas, row: int) -> Strip:
    """One row of `canvas`."""
    segments = [Segment(run.text, _style(run.fore, run.back, run.bold)) for run in canvas.runs(row)]
    return Strip(segments, canvas.chars.shape[1])


@lru_cache(maxsize=4096)
def _style(fore: int, back: int, bold: bool) -> Style:
    return Style(color=_color(fore), bgcolor=_color(back), bold=bold)


def _color(value: int) -> Color:
    return Color.default() if value < 0 else Color.from_rgb(value >> 16, value >> 8 & 255, value & 255)
