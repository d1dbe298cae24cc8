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


def convex_hull(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (maximum `MOST_VERTICES`) and outward faces of the convex hull of `points` (N, 3), m.

    Points in one plane, line or place get a hull that is 1 mm thick. Raises ValueError if there is no hull.
    """
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


def _unit(points: np.ndarray) -> np.ndarray:
    """`points` stretched to the cube from -1 to 1, which suits Qhull's tolerances; a hull stays a hull."""
    low, high = points.min(axis=0), points.max(axis=0)
    stretched: np.ndarray = (points - (low + high) / 2) / ((high - low) / 2)
    return stretched


def _extremes(points: np.ndarray) -> np.ndarray:
    """Indices of the extreme points in `MOST_VERTICES` evenly spread directions, including the axes."""
    points = _unit(points)
    return np.unique([int(_along(points, direction).argmax()) for direction in _directions(MOST_VERTICES)])


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
