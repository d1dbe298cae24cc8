"""The surface of terrain: its height at any place, and its triangles."""

from __future__ import annotations

import math

import numpy as np

from ddenv.arrays import Floats
from ddenv.world.model import Mesh, Terrain
from ddenv.world.pose import Pose

MOST_DRAWN = 160  # heights along each side of what is drawn


def height_at(terrain: Terrain, x: Floats, y: Floats) -> Floats:
    """The heights (...) m of the surface at `x` and `y` (...) m in its frame; NaN where there is no
    ground.
    """
    rows, columns = terrain.heights.shape
    length, width = terrain.size
    return bilinear(
        terrain.heights, (y / width + 0.5) * (rows - 1), (x / length + 0.5) * (columns - 1)
    )


def bilinear(grid: Floats, row: Floats, column: Floats) -> Floats:
    """The values (...) of `grid` (R, C) at these rows and columns (...), which need not be whole;
    NaN beyond its edge.
    """
    # Loaded late: worlds without terrain are shown without it.
    from scipy.ndimage import map_coordinates

    values: Floats = map_coordinates(grid, np.broadcast_arrays(row, column), order=1, cval=np.nan)
    return values


def height_above(terrain: Terrain, pose: Pose, places: Floats) -> float:
    """How high the lowest of `places` (N, 3) m is above the surface of terrain at `pose`, m;
    infinite where there is no ground.
    """
    back = pose.inverse()
    x, y, z = (places @ back.rotation().T + back.position).T
    return float(np.nanmin(z - height_at(terrain, x, y), initial=math.inf))


def surface(terrain: Terrain) -> Mesh:
    """The triangles of terrain, as they are drawn."""
    rows, columns = (
        np.linspace(0, count - 1, min(count, MOST_DRAWN)) for count in terrain.heights.shape
    )
    heights = bilinear(terrain.heights, rows[:, None], columns)
    x, y = (np.linspace(-0.5, 0.5, count) for count in heights.shape[::-1])
    vertices = np.stack(
        [*np.meshgrid(x * terrain.size[0], y * terrain.size[1]), heights], axis=-1
    ).reshape(-1, 3)
    number = np.arange(heights.size).reshape(heights.shape)
    first = number[:-1, :-1]
    beside = number[:-1, 1:]
    above = number[1:, :-1]
    across = number[1:, 1:]
    faces = np.stack([first, beside, across, first, across, above], axis=-1).reshape(-1, 3)
    return Mesh(f"surface of {terrain.origin}", vertices, faces.astype(np.uint32))
