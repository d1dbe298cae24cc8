"""Geometry to character cells: which model fills which half block, and which braille dots a path touches. Pure.

A cell is taken as twice as high as it is wide, so a half block is a square pixel, and metres keep their proportions.
Rows count downwards from the top of the map, which is the greatest y; columns count from the left, the least x.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from ddenv.map.footprints import Footprint

EMPTY = -1
# The bit of a braille glyph (U+2800 + bits) for the dot at [row, column] of its 4 x 2 grid.
DOTS = np.array([[0x01, 0x08], [0x02, 0x10], [0x04, 0x20], [0x40, 0x80]], dtype=np.uint8)
ARROWS = "→↗↑↖←↙↓↘"
# No closer than this, whatever is asked for, m for one pixel.
FINEST = 0.002


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

    def zoomed(self, factor: float) -> View:
        """The same centre, `factor` times closer."""
        return View(self.x, self.y, max(FINEST, self.scale / factor), self.columns, self.rows)


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
    low, high = np.array([math.inf] * 2), np.array([-math.inf] * 2)
    for point in points:
        low, high = np.minimum(low, point), np.maximum(high, point)
    # Small models first: each one decides with those before it whether the next is huge.
    for each in sorted(prints, key=lambda each: each.area):
        spans = np.maximum(high - low, 4.0)
        if np.isfinite(low).all() and each.area > 4 * spans[0] * spans[1]:
            break
        low, high = np.minimum(low, each.low), np.maximum(high, each.high)
    if not np.isfinite(low).all():
        return np.array([-5.0, -5.0]), np.array([5.0, 5.0])
    return low, high


def masks(prints: Sequence[Footprint], view: View) -> list[np.ndarray]:
    """For each model the pixels it fills, as flat indices into a grid of (2 rows, columns)."""
    grid = np.zeros((2 * view.rows, view.columns), dtype=bool)
    filled = []
    for each in prints:
        grid[:] = False
        for polygon in each.polygons:
            _fill(grid, view.pixels(polygon))
        # A model smaller than a pixel still shows.
        column, half = view.pixels(np.array([each.center]))[0]
        seen = 0 <= column < view.columns and 0 <= half < 2 * view.rows
        if seen and (each.area < 4 * view.scale**2 or not each.polygons):
            grid[int(half), int(column)] = True
        filled.append(np.flatnonzero(grid))
    return filled


def owners(filled: Sequence[np.ndarray], view: View, drawn: Iterable[int] | None = None) -> np.ndarray:
    """The model on each pixel, shape (2 rows, columns): the last of the `drawn` ones (all, in order), else EMPTY."""
    grid = np.full(2 * view.rows * view.columns, EMPTY, dtype=np.int32)
    for index in range(len(filled)) if drawn is None else drawn:
        grid[filled[index]] = index
    return grid.reshape(2 * view.rows, view.columns)


def label_cells(grid: np.ndarray, centers: np.ndarray) -> list[tuple[int, int] | None]:
    """The cell for each model's letter: of those it fills, the one nearest to its centre (pixels); None if none is free."""
    owned = np.where(grid[0::2] == grid[1::2], grid[0::2], EMPTY)
    loose = grid[0::2]
    cells: list[tuple[int, int] | None] = []
    for index in range(len(centers)):
        rows, columns = np.nonzero(owned == index)
        if not len(rows):
            rows, columns = np.nonzero(loose == index)
        if not len(rows):
            cells.append(None)
            continue
        away = (columns + 0.5 - centers[index, 0]) ** 2 + (2 * rows + 1 - centers[index, 1]) ** 2
        best = int(np.argmin(away))
        cells.append((int(rows[best]), int(columns[best])))
    return cells


def _fill(grid: np.ndarray, corners: np.ndarray) -> None:
    """Sets the pixels whose centres lie in a convex polygon of pixel coordinates."""
    height, width = grid.shape
    if not np.isfinite(corners).all() or len(corners) < 3:
        return
    low = np.clip(np.floor(corners.min(axis=0)), 0, (width, height)).astype(int)
    high = np.clip(np.ceil(corners.max(axis=0)), 0, (width, height)).astype(int)
    if (low >= high).any():
        return
    xs = np.arange(low[0], high[0]) + 0.5
    ys = np.arange(low[1], high[1])[:, None] + 0.5
    inside = np.ones((high[1] - low[1], high[0] - low[0]), dtype=bool)
    # Anticlockwise in the world is clockwise in pixels, whose y points down.
    for (ax, ay), (bx, by) in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        inside &= (bx - ax) * (ys - ay) - (by - ay) * (xs - ax) <= 1e-9
    grid[low[1] : high[1], low[0] : high[0]] |= inside


def braille(points: np.ndarray, view: View) -> np.ndarray:
    """The braille bits of each cell that the polyline through (N, 2) points in m touches, shape (rows, columns), uint8."""
    cells = np.zeros((view.rows, view.columns), dtype=np.uint8)
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return cells
    dots = _dense(view.pixels(points) * 2)
    x, y = dots[:, 0], dots[:, 1]
    seen = (x >= 0) & (y >= 0) & (x < 2 * view.columns) & (y < 4 * view.rows)
    x, y = x[seen], y[seen]
    np.bitwise_or.at(cells, (y // 4, x // 2), DOTS[y % 4, x % 2])
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
