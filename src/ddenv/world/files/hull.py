"""Convex hulls suitable for contact: never flat, with few vertices."""

from __future__ import annotations

import math

import numpy as np

# Maximum number of vertices: a finer hull only makes every time step slower.
MOST_VERTICES = 256
# A hull thinner than `THIN_RATIO` of its size is thickened to `THICKNESS` m, or to `THICKNESS_RATIO` of a large size.
THIN_RATIO = 1e-5
THICKNESS = 1e-3
THICKNESS_RATIO = 1e-4
# With more points, those inside the hull of a few extreme ones are dropped first: they cost time and memory.
MANY_POINTS = 50_000
FEW_DIRECTIONS = 32
CHUNK = 20_000  # points at a time


def convex_hull(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (maximum `MOST_VERTICES`) and outward faces of the convex hull of `points` (N, 3), m.

    Points in one plane, line or place get a hull that is 1 mm thick. Raises ValueError if there is no hull.
    """
    if len(points) > MANY_POINTS:
        points = _outer(points)
    points = _thickened(np.unique(points, axis=0))
    chosen, faces = _qhull(points)
    if len(chosen) > MOST_VERTICES:
        points = points[chosen][_extremes(points[chosen])]
        chosen, faces = _qhull(points)
    return points[chosen], faces


def _qhull(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The indices of the points that are vertices, and the faces as indices into these. Raises ValueError."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        hull = ConvexHull(_unit(points))
    except QhullError as error:
        raise ValueError(f"has no convex hull: {str(error).partition(chr(10))[0]}") from None
    chosen = np.sort(hull.vertices)
    corners = _unit(points)[hull.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (normals * hull.equations[:, :3]).sum(axis=1) < 0
    faces = np.where(inward[:, None], hull.simplices[:, ::-1], hull.simplices)
    return chosen, np.searchsorted(chosen, faces)


def _outer(points: np.ndarray) -> np.ndarray:
    """The points that may be vertices of the hull; if these are still many, as on a ball, only the most extreme ones."""
    inner = _thickened(np.unique(points[_extremes(points, FEW_DIRECTIONS)], axis=0))
    corners, faces = _qhull(inner)
    first, second, third = (inner[corners][faces[:, corner]] for corner in range(3))
    normals = np.cross(second - first, third - first)
    normals /= _length(normals)[:, None]
    # A point of the inner hull itself must stay, whatever its rounding.
    limits = (normals * first).sum(axis=1) - 1e-9 * np.abs(inner).max()
    chunks = (points[start : start + CHUNK] for start in range(0, len(points), CHUNK))
    outside = np.concatenate([(chunk @ normals.T > limits).any(axis=1) for chunk in chunks])
    points = points[outside]
    return points if len(points) <= MANY_POINTS else points[_extremes(points)]


def _unit(points: np.ndarray) -> np.ndarray:
    """`points` stretched to the cube from -1 to 1, which suits Qhull's tolerances; a hull stays a hull."""
    low, high = points.min(axis=0), points.max(axis=0)
    half = np.where(high > low, (high - low) / 2, 1.0)
    stretched: np.ndarray = (points - (low + high) / 2) / half
    return stretched


def _extremes(points: np.ndarray, count: int = MOST_VERTICES) -> np.ndarray:
    """Indices of the extreme points in `count` evenly spread directions, including the axes."""
    points, directions = _unit(points), _directions(count)
    best, places = [-math.inf] * count, [0] * count
    # In chunks that stay in the processor's cache.
    for start in range(0, len(points), CHUNK):
        chunk = np.asfortranarray(points[start : start + CHUNK])
        for number, direction in enumerate(directions):
            along = _along(chunk, direction)
            place = int(along.argmax())
            if along[place] > best[number]:
                best[number], places[number] = float(along[place]), start + place
    return np.unique(places)


def _directions(count: int) -> list[tuple[float, float, float]]:
    """The six axis directions, which preserve the bounding box, and a spiral of points on the sphere."""
    axes = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    turn = math.pi * (3 - math.sqrt(5))
    rest = count - len(axes)
    heights = [1 - (2 * i + 1) / rest for i in range(rest)]
    rings = [math.sqrt(1 - z * z) for z in heights]
    return axes + [
        (r * math.cos(turn * i), r * math.sin(turn * i), z) for i, (r, z) in enumerate(zip(rings, heights, strict=True))
    ]


def _thickened(points: np.ndarray) -> np.ndarray:
    """`points`; if they lie in one plane, line or place, copies of them on both sides of it."""
    size = math.dist(points.min(axis=0), points.max(axis=0))
    thickness = max(THICKNESS, THICKNESS_RATIO * size)
    for axis in _thin_axes(points, THIN_RATIO * size):
        points = np.concatenate([points - thickness / 2 * axis, points + thickness / 2 * axis])
    return points


def _thin_axes(points: np.ndarray, limit: float) -> list[np.ndarray]:
    """Perpendicular unit vectors along which the extent of `points` is `limit` at most, m.

    Found from successive farthest points, not by a decomposition: sums over all points may differ between machines.
    """
    start = points[_length(points - points[0]).argmax()]
    offsets = points - start
    lengths = _length(offsets)
    if lengths.max() <= limit:
        return list(np.eye(3))
    along = offsets[lengths.argmax()] / lengths.max()
    aside = offsets - _along(offsets, along)[:, None] * along
    widths = _length(aside)
    if widths.max() <= limit:
        first = np.cross(along, np.eye(3)[np.abs(along).argmin()])
        first /= math.sqrt((first * first).sum())
        return [first, np.cross(along, first)]
    normal = np.cross(along, aside[widths.argmax()] / widths.max())
    normal /= math.sqrt((normal * normal).sum())
    heights = _along(offsets, normal)
    return [normal] if heights.max() - heights.min() <= limit else []


def _along(points: np.ndarray, direction: np.ndarray | tuple[float, float, float]) -> np.ndarray:
    # Without BLAS, whose sums may differ between machines.
    along: np.ndarray = points[:, 0] * direction[0] + points[:, 1] * direction[1] + points[:, 2] * direction[2]
    return along


def _length(offsets: np.ndarray) -> np.ndarray:
    lengths: np.ndarray = np.sqrt(offsets[:, 0] ** 2 + offsets[:, 1] ** 2 + offsets[:, 2] ** 2)
    return lengths
