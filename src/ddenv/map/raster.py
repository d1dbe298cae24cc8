"""From metres to character cells: the view of a map, the model in each half block, and the braille
dots of a path.

A cell is assumed to be twice as high as wide, so a half block is a square pixel and proportions are
kept. Rows count downwards from the top of the map, the largest y; columns count from the left, the
smallest x.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from ddenv.world.pose import Point

if TYPE_CHECKING:
    from ddenv.map.footprints import Footprint

SLACK = 1e-9  # tolerance of the fill test at the edges of outlines, pixels
# A polygon thinner than a pixel and longer than this many of them is widened to one: it would have
# gaps, or vanish.
SHORT = 3
EMPTY = -1  # the owner of a pixel without a model
# The bit of a braille glyph (U+2800 + bits) for the dot at [row, column] of its 4 x 2 grid.
DOTS = (0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80)
ARROWS = "→↗↑↖←↙↓↘"
HOLLOW = "⇒⇗⇑⇖⇐⇙⇓⇘"
# Limits of the scale, m per pixel.
FINEST = 0.002
COARSEST = 1e6
MOST_PIXELS = 2_000_000  # painted at a time


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """The part of the world on a map of `columns` x `rows` cells: its centre `x`, `y` in m, and
    `scale` in m per pixel.
    """

    x: float
    y: float
    scale: float
    columns: int
    rows: int

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """Points (N, 2) m to (N, 2) pixels: column and half row, as fractions."""
        left = self.x - self.columns * self.scale / 2
        top = self.y + self.rows * self.scale
        return np.column_stack(
            [(points[:, 0] - left) / self.scale, (top - points[:, 1]) / self.scale]
        )

    def cell(self, x: float, y: float) -> tuple[int, int] | None:
        """Row and column of the cell at (x, y) m; None outside the map."""
        column, half = self.pixels(np.array([[x, y]]))[0]
        if not (0 <= column < self.columns and 0 <= half < 2 * self.rows):
            return None
        return int(half // 2), int(column)

    def point(self, cell: tuple[int, int]) -> Point:
        """The middle of a cell (row, column), m."""
        row, column = cell
        return (
            self.x + (column + 0.5 - self.columns / 2) * self.scale,
            self.y + (self.rows - 2 * row - 1) * self.scale,
        )

    def zoomed(self, factor: float, about: Point | None = None) -> View:
        """The view `factor` times closer; the point `about` (m), by default the centre, stays in
        place.
        """
        scale = min(COARSEST, max(FINEST, self.scale / factor))
        x, y = about or (self.x, self.y)
        part = scale / self.scale
        return View(
            x=x + (self.x - x) * part,
            y=y + (self.y - y) * part,
            scale=scale,
            columns=self.columns,
            rows=self.rows,
        )

    def around(self, x: float, y: float) -> View:
        """The view at the same scale, centred on (x, y) m."""
        return View(x=x, y=y, scale=self.scale, columns=self.columns, rows=self.rows)

    def panned(self, columns: float, rows: float) -> View:
        """The view moved by `columns` to the right and `rows` upwards."""
        return self.around(self.x + columns * self.scale, self.y + 2 * rows * self.scale)


def fit(
    prints: Sequence[Footprint],
    points: Iterable[Point],
    columns: int,
    rows: int,
    margin: float = 1.0,
) -> View:
    """A view of everything relevant (see `extent`), with a margin in m around it."""
    low, high = extent(prints, points)
    low = low - margin
    high = high + margin
    scale = max((high[0] - low[0]) / max(1, columns), (high[1] - low[1]) / max(1, 2 * rows), FINEST)
    return View(
        x=float(low[0] + high[0]) / 2,
        y=float(low[1] + high[1]) / 2,
        scale=float(scale),
        columns=columns,
        rows=rows,
    )


def extent(prints: Sequence[Footprint], points: Iterable[Point]) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner of all `points` and of the models except huge ones, m; 10 m around
    zero for nothing.

    A model is huge if it is several times larger than the area that the smaller models, and the
    points among them, span. The smallest model is shown whole, however short the way between the
    points is: it may be a building.
    """
    corners = np.array([point for point in points if len(point)], dtype=float).reshape(-1, 2)
    boxes = np.array([(*each.low, *each.high, each.area) for each in prints], dtype=float).reshape(
        -1, 5
    )
    # Sorted by size: each model and those before it decide whether the next is huge.
    boxes = boxes[np.argsort(boxes[:, 4], kind="stable")]
    least = corners.min(axis=0, initial=math.inf)
    most = corners.max(axis=0, initial=-math.inf)
    lows = np.minimum.accumulate(np.vstack([least, boxes[:, :2]]))
    highs = np.maximum.accumulate(np.vstack([most, boxes[:, 2:4]]))
    with np.errstate(invalid="ignore"):
        spread = np.maximum(highs - lows, 4.0)[:-1]
    huge = np.flatnonzero(boxes[1:, 4] > 4 * (spread[:, 0] * spread[:, 1])[1:])
    last = huge[0] + 1 if len(huge) else -1
    low = lows[last]
    high = highs[last]
    if not np.isfinite(low).all():
        return np.array([-5.0, -5.0]), np.array([5.0, 5.0])
    return low, high


@dataclass(frozen=True, slots=True, eq=False, kw_only=True)
class Outlines:
    """The polygons of all models in flat arrays: polygon p has `counts[p]` of the `corners` (M, 2)
    m, from `first[p]` on.

    `models[p]` is the model of polygon p, `middles[p]` (2,) m its middle; `lengths[p]` and
    `widths[p]` are its diagonal and its mean width across it, m. Per model: `centers` (N, 2) m, and
    `bare` (N,) if it has none.
    """

    corners: np.ndarray
    first: np.ndarray
    counts: np.ndarray
    models: np.ndarray
    middles: np.ndarray
    lengths: np.ndarray
    widths: np.ndarray
    centers: np.ndarray
    bare: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Spans:
    """Runs of pixels in a grid in row-major order: `lengths[i]` pixels from `starts[i]` on belong
    to `models[i]`.

    They are sorted by model.
    """

    models: np.ndarray
    starts: np.ndarray
    lengths: np.ndarray


def pack(prints: Sequence[Footprint]) -> Outlines:
    """Footprints as arrays, for repeated drawing."""
    polygons = [
        (index, polygon)
        for index, each in enumerate(prints)
        for polygon in each.polygons
        if len(polygon)
    ]
    counts = np.array([len(polygon) for _, polygon in polygons], dtype=np.intp)
    corners = np.concatenate([polygon for _, polygon in polygons]) if polygons else np.zeros((0, 2))
    first = np.cumsum(counts) - counts
    following = np.arange(1, len(corners) + 1)
    following[first + counts - 1] = first
    with np.errstate(invalid="ignore", over="ignore"):
        low = np.minimum.reduceat(corners, first)
        high = np.maximum.reduceat(corners, first)
        here = corners - np.repeat(low, counts, axis=0)
        ahead = here[following]
        areas = (
            np.abs(np.add.reduceat(here[:, 0] * ahead[:, 1] - here[:, 1] * ahead[:, 0], first)) / 2
        )
        lengths = np.hypot(*(high - low).T)
    return Outlines(
        corners=corners,
        first=first,
        counts=counts,
        models=np.array([index for index, _ in polygons], dtype=np.intp),
        middles=(low + high) / 2,
        lengths=lengths,
        widths=areas / np.maximum(lengths, 1e-12),
        centers=np.array([each.center for each in prints]).reshape(-1, 2),
        bare=np.array([not each.polygons for each in prints], dtype=bool),
    )


def masks(prints: Sequence[Footprint], view: View) -> Spans:
    return spans(pack(prints), view)


def spans(outlines: Outlines, view: View) -> Spans:
    width = view.columns
    height = 2 * view.rows
    polygon, row, left, right = rows_of(outlines, view)
    # What is smaller than a pixel stays visible.
    small = outlines.lengths <= SHORT * view.scale
    tiny = np.concatenate([outlines.models[small], np.flatnonzero(outlines.bare)])
    middle = view.pixels(np.concatenate([outlines.middles[small], outlines.centers[outlines.bare]]))
    seen = ((middle >= 0) & (middle < (width, height))).all(axis=1)
    tiny = tiny[seen]
    dots = middle[seen].astype(np.intp)
    models = np.concatenate([outlines.models[polygon], tiny])
    starts = np.concatenate([row * width + left, dots[:, 1] * width + dots[:, 0]])
    lengths = np.concatenate([right - left + 1, np.ones(len(dots), dtype=np.intp)])
    order = np.argsort(models, kind="stable")
    return Spans(models[order], starts[order], lengths[order])


def rows_of(outlines: Outlines, view: View) -> tuple[np.ndarray, ...]:
    """Polygon, row, first and last column of each row of pixels in a polygon.

    A pixel belongs to a polygon if its centre is inside, or to a thin one if it is at most `wider`
    outside.
    """
    width = view.columns
    height = 2 * view.rows
    corners = view.pixels(outlines.corners)
    widths = outlines.widths / view.scale
    wider = np.where((widths < 1) & (outlines.lengths > SHORT * view.scale), (1 - widths) / 2, 0.0)
    with np.errstate(invalid="ignore"):
        low = np.floor(np.minimum.reduceat(corners, outlines.first) - wider[:, None])
        high = np.ceil(np.maximum.reduceat(corners, outlines.first) + wider[:, None])
    whole = np.isfinite(low).all(axis=1) & np.isfinite(high).all(axis=1) & (outlines.counts > 2)
    low = np.clip(np.where(whole[:, None], low, 0), 0, (width, height)).astype(np.intp)
    high = np.clip(np.where(whole[:, None], high, 0), 0, (width, height)).astype(np.intp)
    seen = np.flatnonzero((low < high).all(axis=1))
    heights = (high - low)[seen, 1]
    polygon = np.repeat(seen, heights)
    row = low[polygon, 1] + _within(heights)
    left = low[polygon, 0].astype(float)
    right = high[polygon, 0] - 1.0
    # Each edge in turn narrows the rows to its inner side.
    for edge in range(int(outlines.counts[seen].max(initial=0))):
        some = np.flatnonzero(outlines.counts[polygon] > edge)
        start = outlines.first[polygon[some]]
        count = outlines.counts[polygon[some]]
        ax, ay = corners[start + edge].T
        bx, by = corners[start + (edge + 1) % count].T
        # Anticlockwise in the world is clockwise in pixels, whose y points down: inside is dx (y -
        # ay) - dy (x - ax) <= 0.
        dx = bx - ax
        dy = by - ay
        lean = dx * (row[some] + 0.5 - ay) - SLACK - wider[polygon[some]] * np.hypot(dx, dy)
        up = dy > 0
        down = dy < 0
        flat = dy == 0
        with np.errstate(over="ignore"):
            at = ax + lean / np.where(flat, 1.0, dy) - 0.5
        left[some[up]] = np.maximum(left[some[up]], np.ceil(at[up]))
        right[some[down]] = np.minimum(right[some[down]], np.floor(at[down]))
        right[some[flat & (lean > 0)]] = -1.0
    filled = left <= right
    return polygon[filled], row[filled], left[filled].astype(np.intp), right[filled].astype(np.intp)


def owners(
    filled: Spans, view: View, drawn: Sequence[int] | np.ndarray | None = None
) -> np.ndarray:
    """The model on each pixel, shape (2 rows, columns): the last of the `drawn` ones (default all)
    that fill it, else EMPTY.
    """
    grid = np.full(2 * view.rows * view.columns, EMPTY, dtype=np.int32)
    models = filled.models
    starts = filled.starts
    lengths = filled.lengths
    if drawn is not None:
        some = np.isin(models, drawn)
        models = models[some]
        starts = starts[some]
        lengths = lengths[some]
    ends = np.cumsum(lengths)
    # Large overlapping models have many pixels: paint a limited number at a time.
    cuts = np.searchsorted(ends, np.arange(0, ends[-1] if len(ends) else 0, MOST_PIXELS))
    for start, stop in pairwise([*np.unique(cuts).tolist(), len(ends)]):
        part = slice(start, stop)
        pixels = _within(lengths[part]) + np.repeat(starts[part], lengths[part])
        # The last of several values for one pixel is kept.
        grid[pixels] = np.repeat(models[part], lengths[part])
    return grid.reshape(2 * view.rows, view.columns)


def _within(counts: np.ndarray) -> np.ndarray:
    """0, 1, ... up to each of `counts` in turn."""
    numbers: np.ndarray = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return numbers


def label_cells(grid: np.ndarray, centers: np.ndarray) -> np.ndarray:
    """The cell (row, column) for the letter of each model, shape (N, 2): the filled cell nearest to
    its centre (pixels).

    A model that fills no cell takes one whose upper, or else lower, half it fills; -1 if it is not
    visible.
    """
    upper = grid[0::2]
    lower = grid[1::2]
    cells = _nearest(np.where(upper == lower, upper, EMPTY), centers)
    for halves in (upper, lower):
        missing = cells[:, 0] < 0
        if missing.any():
            cells[missing] = _nearest(halves, centers)[missing]
    return cells


def _nearest(owned: np.ndarray, centers: np.ndarray) -> np.ndarray:
    cells = np.full((len(centers), 2), -1, dtype=np.intp)
    rows, columns = np.nonzero(owned != EMPTY)
    who = owned[rows, columns]
    away = (columns + 0.5 - centers[who, 0]) ** 2 + (2 * rows + 1 - centers[who, 1]) ** 2
    # The last of several values is kept: the nearest cell, and the first of equally near ones.
    order = np.argsort(away, kind="stable")[::-1]
    cells[who[order]] = np.column_stack([rows[order], columns[order]])
    return cells


def braille(points: np.ndarray, view: View, dash: int = 0) -> np.ndarray:
    """The braille bits of each cell on the polyline through `points` (N, 2) m, shape (rows,
    columns), uint8.

    `dash` is the number of dots drawn and then skipped in turn; 0 draws all.
    """
    cells = np.zeros((view.rows, view.columns), dtype=np.uint8)
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return cells
    # The dots along the line, without gaps. Points far outside are invisible, and would only make
    # it long.
    places = np.clip(view.pixels(points) * 2, -4000, 4000)
    counts = np.maximum(1, np.ceil(np.abs(np.diff(places, axis=0)).max(axis=1)).astype(int))
    start = np.repeat(np.arange(len(counts)), counts)
    part = (_within(counts) / np.repeat(counts, counts))[:, None]
    line = places[start] * (1 - part) + places[start + 1] * part
    dots = np.floor(np.vstack([line, places[-1:]])).astype(int)
    if dash:
        dots = dots[np.arange(len(dots)) // dash % 2 == 0]
    x = dots[:, 0]
    y = dots[:, 1]
    seen = (x >= 0) & (y >= 0) & (x < 2 * view.columns) & (y < 4 * view.rows)
    x = x[seen]
    y = y[seen]
    np.bitwise_or.at(cells, (y // 4, x // 2), np.array(DOTS, dtype=np.uint8)[y % 4, x % 2])
    return cells


def arrow(yaw: float, signs: str = ARROWS) -> str:
    return signs[round(yaw / (math.pi / 4)) % 8]
