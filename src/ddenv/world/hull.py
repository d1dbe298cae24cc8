"""Convex hulls: of points in space as a surface, as half spaces or as the outermost points, and of
points in the plane.

scipy is loaded only for hulls in space: views and maps run without it.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from ddenv.arrays import Floats, Integers
from ddenv.world.pose import Point, Vector

# Vertices (N, 3) m, and outward faces (M, 3) as their indices.
Surface = tuple[np.ndarray, np.ndarray]

# Maximum number of vertices: a finer hull only makes every time step slower.
MOST_VERTICES = 256
# A hull thinner than `THIN_RATIO` of its size is thickened to `THICKNESS` m, or to
# `THICKNESS_RATIO` of a large size.
THIN_RATIO = 1e-5
THICKNESS = 1e-3
THICKNESS_RATIO = 1e-4
# Of more points only the most extreme ones count: Qhull takes 10 s and 300 MB for so many on a
# ball.
MANY_POINTS = 300_000
CHUNK = 20_000  # points at a time


def convex_outline(points: np.ndarray) -> np.ndarray:
    """The corners (M, 2) of the convex hull of `points` (N, 2), anticlockwise (Andrew's monotone
    chain).
    """
    ordered = sorted({(round(float(x), 6), round(float(y), 6)) for x, y in points})
    if len(ordered) < 3:
        return np.array(ordered).reshape(-1, 2)
    corners: list[Point] = []
    for side in (ordered, ordered[::-1]):
        chain: list[Point] = []
        for x, y in side:
            while len(chain) > 1:
                (ax, ay), (bx, by) = chain[-2:]
                if (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0:
                    break
                chain.pop()
            chain.append((x, y))
        corners += chain[:-1]
    return np.array(corners)


def convex_hull(points: np.ndarray) -> Surface:
    """Vertices (maximum `MOST_VERTICES`) and outward faces of the convex hull of `points` (N, 3),
    m.

    Points in one plane, line or place get a hull that is 1 mm thick. Raises ValueError if there is
    no hull.
    """
    if len(points) > MANY_POINTS:
        points = points[_extremes(points)]
    points = np.unique(points, axis=0)
    size = math.dist(points.min(axis=0), points.max(axis=0))
    thickness = max(THICKNESS, THICKNESS_RATIO * size)
    for axis in _thin_axes(points, THIN_RATIO * size):
        points = np.concatenate([points - thickness / 2 * axis, points + thickness / 2 * axis])
    chosen, faces = _corners_and_faces(points)
    if len(chosen) > MOST_VERTICES:
        points = points[chosen][_extremes(points[chosen])]
        chosen, faces = _corners_and_faces(points)
    return points[chosen], faces


def outermost(points: Floats) -> Integers:
    """The indices, in order, of those of `points` (N, 3) that are corners of their hull.

    Raises ValueError if all are in one plane.
    """
    return np.sort(_qhull(points).vertices)


def half_spaces(points: Floats, *, joggle: bool = False) -> Floats:
    """The hull of `points` (N, 3) m as rows (M, 4): a unit vector n and an offset d, m.

    A point p is inside if no n @ p + d is positive. Raises ValueError if all are in one plane,
    unless Qhull may `joggle` them: then they get a little thickness.
    """
    return np.asarray(_qhull(points, "QJ" if joggle else None).equations)


def _corners_and_faces(points: np.ndarray) -> Surface:
    """The indices of the points that are vertices, and the faces as indices into these. Raises
    ValueError.
    """
    points = _unit(points)
    hull = _qhull(points)
    chosen = np.sort(hull.vertices)
    corners = points[hull.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (normals * hull.equations[:, :3]).sum(axis=1) < 0
    faces = np.where(inward[:, None], hull.simplices[:, ::-1], hull.simplices)
    return chosen, np.searchsorted(chosen, faces)


def _qhull(points: Floats, options: str | None = None) -> Any:
    from scipy.spatial import ConvexHull, QhullError

    try:
        return ConvexHull(points, qhull_options=options)
    except QhullError as error:
        raise ValueError(f"has no convex hull: {str(error).partition(chr(10))[0]}") from None


def _unit(points: np.ndarray) -> np.ndarray:
    """`points` stretched to the cube from -1 to 1, which suits Qhull's tolerances; a hull stays a
    hull.
    """
    low = points.min(axis=0)
    high = points.max(axis=0)
    half = np.where(high > low, (high - low) / 2, 1.0)
    return np.asarray((points - (low + high) / 2) / half)


def _extremes(points: np.ndarray) -> np.ndarray:
    """Indices of the extreme points in `MOST_VERTICES` directions: a spiral on the sphere, and the
    axes, for the bounding box.
    """
    points = _unit(points)
    directions: list[Vector] = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1)]
    turn = math.pi * (3 - math.sqrt(5))
    rest = MOST_VERTICES - len(directions)
    for number in range(rest):
        height = 1 - (2 * number + 1) / rest
        ring = math.sqrt(1 - height * height)
        directions.append((ring * math.cos(turn * number), ring * math.sin(turn * number), height))
    best = [-math.inf] * len(directions)
    places = [0] * len(directions)
    # In chunks that stay in the processor's cache.
    for start in range(0, len(points), CHUNK):
        chunk = np.asfortranarray(points[start : start + CHUNK])
        for number, direction in enumerate(directions):
            along = _along(chunk, direction)
            place = int(along.argmax())
            if along[place] > best[number]:
                best[number] = float(along[place])
                places[number] = start + place
    return np.unique(places)


def _thin_axes(points: np.ndarray, limit: float) -> list[np.ndarray]:
    """Perpendicular unit vectors along which the extent of `points` is `limit` at most, m.

    Found from successive farthest points, not by a decomposition: sums over all points may differ
    between machines.
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
    if heights.max() - heights.min() <= limit:
        return [normal]
    return []


def _along(points: np.ndarray, direction: np.ndarray | Vector) -> np.ndarray:
    # Without BLAS, whose sums may differ between machines.
    return np.asarray(
        points[:, 0] * direction[0] + points[:, 1] * direction[1] + points[:, 2] * direction[2]
    )


def _length(offsets: np.ndarray) -> np.ndarray:
    return np.asarray(np.sqrt(offsets[:, 0] ** 2 + offsets[:, 1] ** 2 + offsets[:, 2] ** 2))
