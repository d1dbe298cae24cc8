"""What moves on a map from frame to frame: robots, the paths behind them, and the crosshair."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache

from rich.color import Color
from rich.segment import Segment
from rich.style import Style
from textual.strip import Strip

from ddenv.map import arrays as np
from ddenv.map.cells import Cell
from ddenv.map.paint import NUMBERED, Canvas, readable
from ddenv.map.raster import View, arrow, braille, heading
from ddenv.workbench.map.map_colors import Palette
from ddenv.workbench.map.picture import Point
from ddenv.workbench.run.poll import Snapshot


def strip(canvas: Canvas, row: int) -> Strip:
    """One row of `canvas`."""
    segments = [Segment(run.text, _style(run.fore, run.back, run.bold)) for run in canvas.runs(row)]
    return Strip(segments, canvas.chars.shape[1])


@lru_cache(maxsize=4096)
def _style(fore: int, back: int, bold: bool) -> Style:
    return Style(color=_color(fore), bgcolor=_color(back), bold=bold)


def _color(value: int) -> Color:
    if value < 0:
        return Color.default()
    if value >= NUMBERED:
        return Color.from_ansi(value - NUMBERED)
    return Color.from_rgb(value >> 16, value >> 8 & 255, value & 255)


ARMS = (((0, -1), "─"), ((0, 1), "─"), ((-1, 0), "│"), ((1, 0), "│"))


def follow(trails: Mapping[int, list[Point]], snapshot: Snapshot) -> dict[int, list[Point]]:
    """Where the robots that drive now have been, by test, m: those of before and where they are now."""
    grown = {}
    for live in snapshot.live:
        trail = trails.get(live.test, [])
        point = (live.pose[0], live.pose[1])
        if not trail or trail[-1] != point:
            trail.append(point)
        grown[live.test] = trail
    return grown


def robots(
    canvas: Canvas,
    view: View,
    written: np.ndarray,
    snapshot: Snapshot,
    trails: Mapping[int, list[Point]],
    palette: Palette,
) -> None:
    """The robots as arrows and the paths behind them, which hide no letter; those of the candidate in focus stand out."""
    focus = snapshot.focus
    ids = {test.id for test in snapshot.running if focus is not None and test.candidate == focus.index}
    colors = {live.test: palette.live if live.test in ids or not ids else palette.dull for live in snapshot.live}
    for test, trail in trails.items():
        bits = braille(np.array(trail), view)
        bits[written] = 0
        canvas.dots(bits, colors.get(test, palette.dull))
    for live in snapshot.live:
        color = colors[live.test]
        canvas.put(view.cell(live.pose[0], live.pose[1]), arrow(heading(live.pose[3:])), readable(color), color)


def crosshair(canvas: Canvas, cell: Cell, written: np.ndarray, palette: Palette) -> None:
    """Marks a cell by four arms; a letter in it stays to be read."""
    rows, columns = canvas.chars.shape
    row, column = min(cell[0], rows - 1), min(cell[1], columns - 1)
    for (down, right), sign in ARMS:
        place = row + down, column + right
        if 0 <= place[0] < rows and 0 <= place[1] < columns:
            canvas.put(place, sign)
    sign = chr(canvas.chars[row, column]) if written[row, column] else "┼"
    canvas.put((row, column), sign, readable(palette.live), palette.live)
