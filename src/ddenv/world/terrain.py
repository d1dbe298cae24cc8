"""The surface of terrain: its height at any place, and its triangles."""

from __future__ import annotations

import math

import numpy as np

from ddenv.arrays import Floats
from ddenv.world.model import Mesh, Terrain
from ddenv.world.pose import Pose

MOST_TRIANGLES = 50_000  # of what is drawn


def height_at(terrain: Terrain, x: Floats, y: Floats) -> Floats:
    """The heights (...) m of the surface at `x` and `y` (...) m in its frame; NaN where there is no ground."""
    rows, columns = terrain.heights.shape
    return bilinear(
        terrain.heights,
        (y / terrain.size[1] + 0.5) * (rows - 1),
        (x / terrain.size[0] + 0.5) * (columns - 1),
    )


def bilinear(grid: Floats, row: Floats, column: Floats) -> Floats:
    """The values (...) of `grid` (R, C) at these rows and columns (...), which need not be whole; NaN beyond its edge."""
    rows, columns = grid.shape
    inside = (row >= 0) & (row <= rows - 1) & (column >= 0) & (column <= columns - 1)
    below = np.clip(row.astype(int), 0, rows - 2)
    left = np.clip(column.astype(int), 0, columns - 2)
    up, right = row - below, column - left
    flat, first = grid.ravel(), below * columns + left
    near = flat.take(first) * (1 - right) + flat.take(first + 1) * right
    far = flat.take(first + columns) * (1 - right) + flat.take(first + columns + 1) * right
    return np.where(inside, near * (1 - up) + far * up, np.nan)


def clearance(terrain: Terrain, pose: Pose, places: Floats) -> float:
    """How high the lowest of `places` (N, 3) m is above the surface of terrain at `pose`, m; infinite where there is no ground."""
    back = pose.inverse()
    x, y, z = (places @ back.rotation().T + back.position).T
    above = z - height_at(terrain, x, y)
    return float(np.nanmin(above, initial=math.inf))


def surface(terrain: Terrain) -> Mesh:
    """The triangles of terrain, of at most about `MOST_TRIANGLES`."""
    step = max(1, math.ceil(math.sqrt(2 * terrain.heights.size / MOST_TRIANGLES)))
    rows, columns = (np.unique(np.append(np.arange(0, count, step), count - 1)) for count in terrain.heights.shape)
    x = (columns / (terrain.heights.shape[1] - 1) - 0.5) * terrain.size[0]
    y = (rows / (terrain.heights.shape[0] - 1) - 0.5) * terrain.size[1]
    heights = terrain.heights[np.ix_(rows, columns)]
    vertices = np.stack([*np.meshgrid(x, y), heights], axis=-1).reshape(-1, 3)
    first = (np.arange(len(rows) - 1)[:, None] * len(columns) + np.arange(len(columns) - 1)).ravel()
    beside, above, across = first + 1, first + len(columns), first + len(columns) + 1
    faces = np.vstack([np.column_stack([first, beside, across]), np.column_stack([first, across, above])])
    faces = faces[np.isfinite(vertices[faces, 2]).all(axis=1)]
    return Mesh(f"surface of {terrain.origin}", np.nan_to_num(vertices), faces.astype(np.uint32))
