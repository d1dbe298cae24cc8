"""The convex hull of points, made fit for contact: never flat, and of few vertices."""

from __future__ import annotations

import math

import numpy as np

# Contact needs no more; a finer hull only costs time in every step of a run.
MOST_VERTICES = 256
# What is thinner than this part of its own size is grown: to `THICKNESS` m, or for large ones to `THICKNESS_RATIO` of the size.
THIN_RATIO = 1e-5
THICKNESS = 1e-3
THICKNESS_RATIO = 1e-4


def convex_hull(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Vertices (at most `MOST_VERTICES`) and outward faces of the convex hull of `points` (N, 3), in m.

    Points in a plane, on a line or in one place get a hull that is 1 mm thick. Raises ValueError if there is no hull.
    """
    points = _thickened(np.unique(points, axis=0))
    chosen, faces = _qhull(points)
    if len(chosen) > MOST_VERTICES:
        points = points[chosen][_extremes(points[chosen])]
        chosen, faces = _qhull(points)
    return points[chosen], faces


def _qhull(points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which of the points are vertices, and the faces as numbers of those."""
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
    """`points` stretched to the cube from -1 to 1: Qhull's tolerances suit that, and a hull stays a hull."""
    low, high = points.min(axis=0), points.max(axis=0)
    return (points - (low + high) / 2) / ((high - low) / 2)


def _extremes(points: np.ndarray) -> np.ndarray:
    """Numbers of at most `MOST_VERTICES` points: the farthest ones in directions spread evenly, the axes among them."""
    points = _unit(points)
    return np.unique([int(_along(points, direction).argmax()) for direction in _directions(MOST_VERTICES)])


def _directions(count: int) -> list[tuple[float, float, float]]:
    """The six axis directions, which keep the bounding box, and points of a spiral on the sphere."""
    axes = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    turn = math.pi * (3 - math.sqrt(5))
    rest = count - len(axes)
    heights = [1 - (2 * i + 1) / rest for i in range(rest)]
    rings = [math.sqrt(1 - z * z) for z in heights]
    return axes + [
        (r * math.cos(turn * i), r * math.sin(turn * i), z) for i, (r, z) in enumerate(zip(rings, heights, strict=True))
    ]


def _thickened(points: np.ndarray) -> np.ndarray:
    """`points`, and where they lie in a plane, on a line or in one place, copies on both sides of it."""
    size = math.dist(points.min(axis=0), points.max(axis=0))
    thickness = max(THICKNESS, THICKNESS_RATIO * size)
    for axis in _thin_axes(points, THIN_RATIO * size):
        points = np.concatenate([points - thickness / 2 * axis, points + thickness / 2 * axis])
    return points


def _thin_axes(points: np.ndarray, limit: float) -> list[np.ndarray]:
    """Unit vectors at right angles to each other, along which `points` reach no farther than `limit`.

    By the farthest points, one after the other, instead of a decomposition: sums over all points may differ between machines.
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


def _along(points: np.ndarray, direction) -> np.ndarray:
    return points[:, 0] * direction[0] + points[:, 1] * direction[1] + points[:, 2] * direction[2]


def _length(offsets: np.ndarray) -> np.ndarray:
    return np.sqrt(offsets[:, 0] ** 2 + offsets[:, 1] ** 2 + offsets[:, 2] ** 2)
