"""Which rows of pixels convex outlines fill, for thousands of them at once: arrays instead of a mask for each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ddenv.map import arrays as np

if TYPE_CHECKING:
    from ddenv.map.footprints import Footprint

# So much of a pixel may the middle of one be outside of an outline's edge, and still be filled.
SLACK = 1e-9


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
