"""Draws the map of a world and its run: models, paths and letters, then the robots and the
crosshair.
"""

from __future__ import annotations

from array import array
from collections.abc import Sequence
from dataclasses import dataclass, replace
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
from ddenv.map.raster import (
    ARROWS,
    EMPTY,
    HOLLOW,
    Spans,
    View,
    arrow,
    braille,
    fit,
    owners,
    pack,
    spans,
)
from ddenv.runfile.snapshot import Snapshot
from ddenv.runfile.store import COLUMNS
from ddenv.text import plain, shortened
from ddenv.workbench.map.map_colors import DULL, FAINT, ORIGINAL, PATH, REMOVED, Palette, unpacked
from ddenv.workbench.map.map_words import PARTING
from ddenv.workbench.map.model_looks import Looks, fill, ghosts, kept, looks
from ddenv.workbench.map.place import MovedPrints, Shown
from ddenv.world.pose import Point, Vector, heading, pose_of

if TYPE_CHECKING:
    from ddenv.map.footprints import Footprint

# Dots of the original path, or of the second way, and of the gaps in it.
DASH = 5
# In a world that is so many times as wide as the ways of the tests that are shown, the map fits
# these alone.
LARGE = 4
# Names are cut to the first of these lengths, in cells, for which there is room.
LENGTHS = (26, 18, 10)
ARMS = (((0, -1), "─"), ((0, 1), "─"), ((-1, 0), "│"), ((1, 0), "│"))
# A path, m, its colour, and its dash: this number of dots and of gaps in turn, 0 for a whole line.
_Line = tuple[np.ndarray, int, int]
# The place and heading of a robot, its colour, and the arrows to draw it with.
_Robot = tuple[Vector, int, str]


# Lying models are the slow part of a frame: 16 of 19 ms with 3,000 models, and only zooming and
# panning change it.
_outlines = lru_cache(maxsize=4)(pack)


@lru_cache(maxsize=4)
def _lying(prints: tuple[Footprint, ...], view: View) -> tuple[Spans, np.ndarray]:
    """The pixels that the models fill in `view`, and their centres in pixels, (N, 2)."""
    outlines = _outlines(prints)
    return spans(outlines, view), view.pixels(outlines.centers)


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Picture:
    """A canvas for `view`, with the looks of the models and the owner of each pixel: kept models in
    `grid`, removed ones in `gone`.

    `dotted` cells show removed models, `written` ones bear a letter or a mark. `cells` is where
    each model's sign begins, if it has one.
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
        rows, columns = self.canvas.chars.shape
        return cell[0] < int(rows) and cell[1] < int(columns)

    def owner(self, cell: Cell) -> int | None:
        """The number of the model that is seen in a cell, a removed one if there are dots; None if
        there is none.
        """
        row, column = cell
        grid = self.gone if self.dotted[cell] else self.grid
        owner = int(grid[2 * row : 2 * row + 2, column].max())
        if owner == EMPTY:
            return None
        return owner


class MapDrawing:
    """Draws frames of what is `Shown`."""

    def __init__(self) -> None:
        self._trails: dict[int, list[Point]] = {}
        self._moved: MovedPrints | None = None
        # The last picture, and what it is of.
        self._of: tuple[Shown, View, Palette] | None = None
        self._picture: Picture | None = None

    def fitting(self, shown: Shown, columns: int, rows: int) -> View:
        """A view of all important places; in a large world, of the ways of finished tests."""
        path = _path(shown.snapshot.evidence)
        points = path[np.isfinite(path).all(axis=1)].tolist()
        points += [point for way in shown.ways for point in way.points.tolist()]
        points += [point for point in (shown.start, shown.place.goal, shown.failure) if point]
        whole = fit(shown.place.prints, points, columns, rows, margin=0.4)
        ways = fit((), points, columns, rows, margin=2.0) if shown.ways else whole
        if whole.scale > LARGE * ways.scale:
            return ways
        return whole

    def follow(self, snapshot: Snapshot) -> None:
        """Adds to the paths behind the robots that drive now."""
        self._trails = {live.test: self._trails.get(live.test, []) for live in snapshot.live}
        for live in snapshot.live:
            trail = self._trails[live.test]
            point = (live.pose[0], live.pose[1])
            if trail[-1:] != [point]:
                trail.append(point)

    def frame(
        self, shown: Shown, view: View, palette: Palette, cursor: Cell | None
    ) -> tuple[Canvas, Picture]:
        """A new frame, and its picture without robots and crosshair. Without a `cursor` it has no
        crosshair.
        """
        shown = self._with_live(shown)
        still = self._still(shown, view, palette)
        canvas = still.canvas.copy()
        paths: list[_Line] = []
        robots: list[_Robot] = []
        if shown.ways:
            # The second one, a hollow arrow, is below the first one.
            looks_of = ((palette.live, 0, ARROWS), (palette.shade(DULL), DASH, HOLLOW))
            for way, (color, dash, signs) in list(zip(shown.ways, looks_of, strict=False))[::-1]:
                paths.append((way.points[: way.gone], color, dash))
                if way.robot is not None:
                    robots.append((way.robot, color, signs))
        else:
            ids = _in_focus(shown.snapshot)
            dull = palette.shade(DULL)
            trails = self._trails if "path" in shown.layers else {}
            for one in shown.snapshot.live:
                color = palette.live if one.test in ids or not ids else dull
                paths.append((np.array(trails.get(one.test, [])).reshape(-1, 2), color, 0))
                robots.append(((one.pose[0], one.pose[1], heading(one.pose[3:])), color, ARROWS))
        for points, color, dash in paths:
            bits = braille(points, view, dash)
            # They hide no letter.
            bits[still.written] = 0
            canvas.dots(bits, color)
        for (x, y, yaw), color, signs in robots:
            canvas.put(view.cell(x, y), arrow(yaw, signs), readable(color), color)
        if cursor is not None:
            _crosshair(canvas, cursor, still.written, palette)
        return canvas, still

    def _still(self, shown: Shown, view: View, palette: Palette) -> Picture:
        """The last one again if only the crosshair or the focus moved."""
        of = shown, view, palette
        if (
            self._picture is None
            or self._of is None
            or any(a is not b for a, b in zip(of, self._of, strict=True))
        ):
            self._of = of
            self._picture = _still(*of)
        return self._picture

    def _with_live(self, shown: Shown) -> Shown:
        """With the models where they are in the running test whose robot stands out."""
        live = None
        if not shown.ways and shown.snapshot.live:
            ids = _in_focus(shown.snapshot)
            live = next(
                (each for each in shown.snapshot.live if each.test in ids), shown.snapshot.live[0]
            )
        if (live is None or not live.models) and self._moved is None:
            return shown
        if self._moved is None or self._moved.place is not shown.place:
            self._moved = MovedPrints(shown.place)
        if live is None:
            poses = {}
        else:
            poses = {name: pose_of(values) for name, values in live.models.items()}
        prints = self._moved.at(poses)
        if prints is shown.place.prints:
            return shown
        return replace(shown, place=replace(shown.place, prints=prints))


def _in_focus(snapshot: Snapshot) -> frozenset[int]:
    focus = snapshot.focus
    return frozenset(
        test.id for test in snapshot.running if focus is not None and test.candidate == focus.index
    )


def _still(shown: Shown, view: View, palette: Palette) -> Picture:
    how = looks(shown.place.prints, kept(shown), palette)
    filled, centers = _lying(shown.place.prints, view)
    canvas = Canvas(view.rows, view.columns, palette.back)
    grid = owners(filled, view, np.flatnonzero(how.kinds != REMOVED))
    gone = owners(filled, view, np.flatnonzero(how.kinds == REMOVED))
    fill(canvas, grid, how)
    dotted, written = (np.zeros(canvas.chars.shape, dtype=bool) for _ in range(2))
    if "removed" in shown.layers:
        dotted = ghosts(canvas, gone, grid, how, palette.shade(FAINT))
    for points, color, dash in _lines(shown, palette):
        canvas.dots(braille(points, view, dash), color)
    # Letters with their own backgrounds, so that they are easy to find.
    failure = shown.failure if "failure" in shown.layers else None
    places = [
        (shown.start, "S", palette.start),
        (shown.place.goal, "G", palette.goal),
        (failure, "×", palette.failure),
    ]
    marks: dict[Cell, tuple[str, int]] = {}
    for point, sign, ground in (*places, (shown.parting, PARTING, palette.live)):
        if point and np.isfinite(point).all() and (cell := view.cell(*point)) is not None:
            marks[cell] = sign, ground
    cells = place_signs(grid, centers, how.signs, marks)
    for index, (row, column) in cells.items():
        text = how.signs.texts[index]
        tone = how.looks[how.tones[index]]
        canvas.put((row, column), text, back=tone.fill)
        written[row, column : column + len(text)] = True
    for cell, (sign, ground) in marks.items():
        canvas.put(cell, sign, readable(ground), ground)
        written[cell] = True
    still = Picture(
        view=view,
        how=how,
        canvas=canvas,
        grid=grid,
        gone=gone,
        dotted=dotted,
        written=written,
        cells=cells,
    )
    if "names" in shown.layers:
        _names(still, shown.place.prints, shown.failure or shown.start)
    return still


def _names(drawn: Picture, prints: Sequence[Footprint], near: Point | None) -> None:
    """Writes the names of kept models beside their signs: the nearest to the place `near` first,
    then the largest; none overlap.
    """
    canvas = drawn.canvas
    written = drawn.written
    view = drawn.view
    kept = np.flatnonzero(drawn.how.kinds != REMOVED).tolist()
    away = {index: round(prints[index].distance(near), 1) if near else 0.0 for index in kept}
    for index in sorted(kept, key=lambda index: (away[index], -prints[index].area)):
        at = drawn.cells.get(index) or view.cell(*prints[index].center)
        if at is None:
            continue
        sign = len(drawn.how.signs.texts[index]) if index in drawn.cells else 0
        texts = dict.fromkeys(shortened(plain(prints[index].name), length) for length in LENGTHS)
        found = next((place for text in texts if (place := _room(drawn, at, text, sign))), None)
        if found is not None:
            row, column, text = found
            canvas.put((row, column), text)
            written[row, column : column + len(text)] = True


def _room(drawn: Picture, at: tuple[int, int], text: str, sign: int) -> tuple[int, int, str] | None:
    """The row and column for a name beside a sign of so many cells, or on the model without one;
    None where there is no room.
    """
    begins = [(0, 0), (-1, 0), (1, 0)]
    if sign:
        begins = [(0, sign + 1), (0, -len(text) - 1), (-1, 0), (1, 0)]
    for down, right in begins:
        row = at[0] + down
        column = at[1] + right
        if not (0 <= row < drawn.view.rows and 0 <= column <= drawn.view.columns - len(text)):
            continue
        # With a free cell on each side names stay apart.
        if not drawn.written[
            row, max(0, column - (right != sign + 1)) : column + len(text) + 1
        ].any():
            return row, column, text
    return None


def _lines(shown: Shown, palette: Palette) -> Sequence[_Line]:
    layers = shown.layers
    snapshot = shown.snapshot
    signs = {"f": palette.failure, "goal": palette.goal}
    limits = [(ring, signs.get(verdict, palette.shade(DULL)), 0) for verdict, ring in shown.limits]
    if shown.ways or limits:
        both = zip(
            shown.ways, (palette.shade(PATH), palette.shade(ORIGINAL)), (0, DASH), strict=False
        )
        return [*limits, *[(way.points, color, dash) for way, color, dash in both][::-1]]
    lines = [(_path(snapshot.evidence), palette.shade(PATH), 0)] if "path" in layers else []
    if "original" in layers and not shown.same_paths:
        lines.insert(0, (_path(snapshot.original), palette.shade(ORIGINAL), DASH))
    return lines


def _path(rows: array[float] | None) -> np.ndarray:
    """Flat rows of a motion as (N, 2) m."""
    if rows is None:
        return np.zeros((0, 2))
    return np.array(rows, dtype=float).reshape(-1, COLUMNS)[:, 1:3]


def _crosshair(canvas: Canvas, cell: Cell, written: np.ndarray, palette: Palette) -> None:
    rows, columns = canvas.chars.shape
    row = min(cell[0], rows - 1)
    column = min(cell[1], columns - 1)
    for (down, right), sign in ARMS:
        place = row + down, column + right
        if 0 <= place[0] < rows and 0 <= place[1] < columns:
            canvas.put(place, sign)
    sign = chr(canvas.chars[row, column]) if written[row, column] else "┼"
    canvas.put((row, column), sign, readable(palette.live), palette.live)


def strip(canvas: Canvas, row: int) -> Strip:
    segments = [Segment(run.text, _style(run.fore, run.back, run.bold)) for run in canvas.runs(row)]
    return Strip(segments, canvas.chars.shape[1])


@lru_cache(maxsize=4096)
def _style(fore: int, back: int, bold: bool) -> Style:
    fore_color, back_color = (
        Color.default() if each < 0 else Color.from_rgb(*unpacked(each)) for each in (fore, back)
    )
    return Style(color=fore_color, bgcolor=back_color, bold=bold)
