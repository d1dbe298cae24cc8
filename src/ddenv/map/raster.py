"""Geometry to character cells: which model fills which half block, and which braille dots a path touches. Pure.

A cell is taken as twice as high as it is wide, so a half block is a square pixel, and metres keep their proportions.
Rows count downwards from the top of the map, which is the greatest y; columns count from the left, the least x.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import TYPE_CHECKING

from ddenv.map import arrays as np

if TYPE_CHECKING:
    from ddenv.map.footprints import Footprint

# So much of a pixel may the middle of one be outside of an outline's edge, and still be filled.
SLACK = 1e-9
EMPTY = -1
# The bit of a braille glyph (U+2800 + bits) for the dot at [row, column] of its 4 x 2 grid.
DOTS = (0x01, 0x08), (0x02, 0x10), (0x04, 0x20), (0x40, 0x80)
ARROWS = "→↗↑↖←↙↓↘"
# No closer and no farther than this, whatever is asked for, m for one pixel.
FINEST, COARSEST = 0.002, 1e6
MOST_PIXELS = 2_000_000


@dataclass(frozen=True, slots=True)
class View:
    """What a map of `columns` x `rows` cells shows: `x`, `y` is its centre in m, `scale` is m for one pixel."""

    x: float
    y: float
    scale: float
    columns: int
    rows: int

    def pixels(self, points: np.ndarray) -> np.ndarray:
        """(N, 2) m to (N, 2) pixels: column and half row, fractions kept."""
        left = self.x - self.columns * self.scale / 2
        top = self.y + self.rows * self.scale
        return np.column_stack([(points[:, 0] - left) / self.scale, (top - points[:, 1]) / self.scale])

    def cell(self, x: float, y: float) -> tuple[int, int] | None:
        """Row and column of the cell that holds (x, y), or None outside the map."""
        column, half = self.pixels(np.array([[x, y]]))[0]
        if not (0 <= column < self.columns and 0 <= half < 2 * self.rows):
            return None
        return int(half // 2), int(column)

    def point(self, cell: tuple[int, int]) -> tuple[float, float]:
        """The middle of a cell (row, column), m."""
        row, column = cell
        return (
            self.x + (column + 0.5 - self.columns / 2) * self.scale,
            self.y + (self.rows - 2 * row - 1) * self.scale,
        )

    def zoomed(self, factor: float, about: tuple[float, float] | None = None) -> View:
        """`factor` times closer; the point `about` (m) stays where it is seen, else the centre does."""
        scale = min(COARSEST, max(FINEST, self.scale / factor))
        x, y = about or (self.x, self.y)
        part = scale / self.scale
        return View(x + (self.x - x) * part, y + (self.y - y) * part, scale, self.columns, self.rows)

    def around(self, x: float, y: float) -> View:
        """As close, with (x, y) m in the middle."""
        return View(x, y, self.scale, self.columns, self.rows)

    def panned(self, columns: float, rows: float) -> View:
        """So many cells to the right and upwards."""
        return self.around(self.x + columns * self.scale, self.y + 2 * rows * self.scale)


def fit(
    prints: Sequence[Footprint],
    points: Iterable[tuple[float, float]],
    columns: int,
    rows: int,
    margin: float = 1.0,
) -> View:
    """A view of everything that matters (see `extent`), with `margin` m around it."""
    low, high = extent(prints, points)
    low, high = low - margin, high + margin
    scale = max((high[0] - low[0]) / max(1, columns), (high[1] - low[1]) / max(1, 2 * rows), FINEST)
    return View(float(low[0] + high[0]) / 2, float(low[1] + high[1]) / 2, float(scale), columns, rows)


def extent(prints: Sequence[Footprint], points: Iterable[tuple[float, float]]) -> tuple[np.ndarray, np.ndarray]:
    """Lowest and highest corner of all `points` and of the models, but of huge ones, m. Of nothing it is 10 m around zero.

    Huge is a model several times larger than the area that the points and the other models span.
    """
    corners = np.array([point for point in points if len(point)], dtype=float).reshape(-1, 2)
    boxes = np.array([(*each.low, *each.high, each.area) for each in prints], dtype=float).reshape(-1, 5)
    # Small models first: each one decides with those before it whether the next is huge.
    boxes = boxes[np.argsort(boxes[:, 4], kind="stable")]
    least, most = corners.min(axis=0, initial=math.inf), corners.max(axis=0, initial=-math.inf)
    lows = np.minimum.accumulate(np.vstack([least, boxes[:, :2]]))
    highs = np.maximum.accumulate(np.vstack([most, boxes[:, 2:4]]))
    with np.errstate(invalid="ignore"):
        spread = np.maximum(highs - lows, 4.0)[:-1]
    huge = np.flatnonzero(np.isfinite(lows[:-1]).all(axis=1) & (boxes[:, 4] > 4 * spread[:, 0] * spread[:, 1]))
    last = huge[0] if len(huge) else -1
    low, high = lows[last], highs[last]
    if not np.isfinite(low).all():
        return np.array([-5.0, -5.0]), np.array([5.0, 5.0])
    return low, high


@dataclass(frozen=True, slots=True, eq=False)
class Outlines:
    """The polygons of all models one after another: `corners` (M, 2) m; polygon p has `counts[p]` of them from `first[p]` on.

    `models[p]` is the model of polygon p. Of each model `centers` (N, 2) m, `areas` (N,) m^2, and whether it is `bare` of polygons.
    """

    corners: np.ndarray
    first: np.ndarray
    counts: np.ndarray
    models: np.ndarray
    centers: np.ndarray
    areas: np.ndarray
    bare: np.ndarray


@dataclass(frozen=True, slots=True, eq=False)
class Spans:
    """Runs of pixels in a grid that is read row by row: `lengths[i]` pixels from `starts[i]` on belong to `models[i]`.

    They are in the order of the models, of which there are `count`.
    """

    models: np.ndarray
    starts: np.ndarray
    lengths: np.ndarray
    count: int


def pack(prints: Sequence[Footprint]) -> Outlines:
    """Footprints as arrays, which can be drawn again and again."""
    polygons = [(index, polygon) for index, each in enumerate(prints) for polygon in each.polygons if len(polygon)]
    counts = np.array([len(polygon) for _, polygon in polygons], dtype=np.intp)
    return Outlines(
        np.concatenate([polygon for _, polygon in polygons]) if polygons else np.zeros((0, 2)),
        np.cumsum(counts) - counts,
        counts,
        np.array([index for index, _ in polygons], dtype=np.intp),
        np.array([each.center for each in prints]).reshape(-1, 2),
        np.array([each.area for each in prints]),
        np.array([not each.polygons for each in prints], dtype=bool),
    )


def masks(prints: Sequence[Footprint], view: View) -> Spans:
    """The pixels that each model fills, in a grid of (2 rows, columns)."""
    return spans(pack(prints), view)


def spans(outlines: Outlines, view: View) -> Spans:
    """The same of models that are packed already."""
    width, height = view.columns, 2 * view.rows
    polygon, row, left, right = rows_of(view.pixels(outlines.corners), outlines, width, height)
    # A model smaller than a pixel still shows.
    tiny = np.flatnonzero((outlines.areas < 4 * view.scale**2) | outlines.bare)
    middle = view.pixels(outlines.centers[tiny])
    seen = ((middle >= 0) & (middle < (width, height))).all(axis=1)
    tiny, dots = tiny[seen], middle[seen].astype(np.intp)
    models = np.concatenate([outlines.models[polygon], tiny])
    starts = np.concatenate([row * width + left, dots[:, 1] * width + dots[:, 0]])
    lengths = np.concatenate([right - left + 1, np.ones(len(tiny), dtype=np.intp)])
    order = np.argsort(models, kind="stable")
    return Spans(models[order], starts[order], lengths[order], len(outlines.areas))


def rows_of(corners: np.ndarray, outlines: Outlines, width: int, height: int) -> tuple[np.ndarray, ...]:
    """Polygon, row, first and last column of each row of pixels inside a polygon; `corners` are those of `outlines` in pixels.

    A pixel is inside where its middle is.
    """
    if not len(outlines.first):
        return (np.zeros(0, dtype=np.intp),) * 4
    with np.errstate(invalid="ignore"):
        low = np.floor(np.minimum.reduceat(corners, outlines.first))
        high = np.ceil(np.maximum.reduceat(corners, outlines.first))
    whole = np.isfinite(low).all(axis=1) & np.isfinite(high).all(axis=1) & (outlines.counts > 2)
    low = np.clip(np.where(whole[:, None], low, 0), 0, (width, height)).astype(np.intp)
    high = np.clip(np.where(whole[:, None], high, 0), 0, (width, height)).astype(np.intp)
    seen = np.flatnonzero((low < high).all(axis=1))
    heights = (high - low)[seen, 1]
    polygon = np.repeat(seen, heights)
    row = low[polygon, 1] + np.arange(len(polygon)) - np.repeat(np.cumsum(heights) - heights, heights)
    left, right = low[polygon, 0].astype(float), high[polygon, 0] - 1.0
    for edge in range(int(outlines.counts[seen].max(initial=0))):
        _cut(corners, outlines, edge, polygon, row + 0.5, left, right)
    filled = left <= right
    return polygon[filled], row[filled], left[filled].astype(np.intp), right[filled].astype(np.intp)


def _cut(corners: np.ndarray, outlines: Outlines, edge: int, polygon, ys, left, right) -> None:
    """Moves `left` and `right` of all rows (at `ys`) to the inner side of this edge of their polygons."""
    some = np.flatnonzero(outlines.counts[polygon] > edge)
    own = polygon[some]
    start = outlines.first[own]
    ax, ay = corners[start + edge].T
    bx, by = corners[start + (edge + 1) % outlines.counts[own]].T
    # Anticlockwise in the world is clockwise in pixels, whose y points down: inside is dx (y - ay) - dy (x - ax) <= 0.
    dx, dy = bx - ax, by - ay
    lean = dx * (ys[some] - ay) - SLACK
    flat = dy == 0
    with np.errstate(over="ignore"):
        at = ax + lean / np.where(flat, 1.0, dy) - 0.5
    up, down = dy > 0, dy < 0
    left[some[up]] = np.maximum(left[some[up]], np.ceil(at[up]))
    right[some[down]] = np.minimum(right[some[down]], np.floor(at[down]))
    right[some[flat & (lean > 0)]] = -1.0


def owners(filled: Spans, view: View, drawn: Iterable[int] | None = None) -> np.ndarray:
    """The model on each pixel, shape (2 rows, columns): of the `drawn` ones (or all) that fill it the last, else EMPTY."""
    grid = np.full(2 * view.rows * view.columns, EMPTY, dtype=np.int32)
    models, starts, lengths = filled.models, filled.starts, filled.lengths
    if drawn is not None:
        wanted = np.zeros(filled.count, dtype=bool)
        wanted[list(drawn) if not isinstance(drawn, np.ndarray) else drawn] = True
        some = wanted[models]
        models, starts, lengths = models[some], starts[some], lengths[some]
    ends = np.cumsum(lengths)
    # Large models on top of each other are many pixels: a part of them at a time.
    cuts = np.searchsorted(ends, np.arange(0, ends[-1] if len(ends) else 0, MOST_PIXELS))
    for start, stop in pairwise([*np.unique(cuts).tolist(), len(ends)]):
        part = slice(start, stop)
        first = ends[part] - lengths[part]
        pixels = np.arange(first[0], ends[stop - 1]) + np.repeat(starts[part] - first, lengths[part])
        # Of several values for one pixel the last one stays.
        grid[pixels] = np.repeat(models[part], lengths[part])
    return grid.reshape(2 * view.rows, view.columns)


def label_cells(grid: np.ndarray, centers: np.ndarray) -> np.ndarray:
    """The cell (row, column) for each model's letter, shape (N, 2): of those it fills, the one nearest to its centre (pixels).

    One that fills no cell takes an upper half, or else a lower one; -1 where it is not seen.
    """
    upper, lower = grid[0::2], grid[1::2]
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
    # The last of several values stays: that is the nearest, and of equally near ones the first.
    order = np.argsort(away, kind="stable")[::-1]
    cells[who[order]] = np.column_stack([rows[order], columns[order]])
    return cells


def braille(points: np.ndarray, view: View, dash: int = 0) -> np.ndarray:
    """The braille bits of each cell that the polyline through (N, 2) points in m touches, shape (rows, columns), uint8.

    With `dash` so many dots are left out after as many.
    """
    cells = np.zeros((view.rows, view.columns), dtype=np.uint8)
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return cells
    dots = _dense(view.pixels(points) * 2)
    if dash:
        dots = dots[np.arange(len(dots)) // dash % 2 == 0]
    x, y = dots[:, 0], dots[:, 1]
    seen = (x >= 0) & (y >= 0) & (x < 2 * view.columns) & (y < 4 * view.rows)
    x, y = x[seen], y[seen]
    np.bitwise_or.at(cells, (y // 4, x // 2), np.array(DOTS, dtype=np.uint8)[y % 4, x % 2])
    return cells


def _dense(dots: np.ndarray) -> np.ndarray:
    """Whole dots along a polyline, without gaps."""
    # What is far outside cannot be seen, and would only make the line long.
    dots = np.clip(dots, -4000, 4000)
    steps = np.abs(np.diff(dots, axis=0)).max(axis=1) if len(dots) > 1 else np.zeros(0)
    counts = np.maximum(1, np.ceil(steps).astype(int))
    if not len(counts):
        return np.floor(dots).astype(int)
    start = np.repeat(np.arange(len(counts)), counts)
    along = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    part = (along / np.repeat(counts, counts))[:, None]
    line = dots[start] * (1 - part) + dots[start + 1] * part
    return np.floor(np.vstack([line, dots[-1:]])).astype(int)


def arrow(yaw: float) -> str:
    """The arrow nearest to a heading, rad, 0 along x."""
    return ARROWS[round(yaw / (math.pi / 4)) % 8]


def heading(quaternion: Sequence[float]) -> float:
    """The yaw of a quaternion w, x, y, z, rad."""
    w, x, y, z = quaternion
    return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
