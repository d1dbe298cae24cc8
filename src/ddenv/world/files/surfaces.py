"""Meshes that are ground: large open surfaces that each vertical line meets once become heights, as
those of a heightmap.
"""

from __future__ import annotations

import numpy as np
from threadpoolctl import threadpool_limits

from ddenv.world.access import Unusable
from ddenv.world.files.heights import pack_heights
from ddenv.world.hull import Surface
from ddenv.world.terrain import bilinear

LARGE = 8.0  # m along both sides
FINE = 256  # triangles; a roof has fewer
LEVEL = 0.02  # less height than this is a flat floor, m
GAPS = 0.01  # the share of its rectangle that a surface may leave empty, or cover twice
OFF = 0.01  # how far the heights may be from the mesh, m
# The share of the sides beside the edges in which no height is taken: numbers in files are rounded.
EDGE = 1e-5
COUNTS = (33, 129, 513, 1025)  # of heights along the longer side: the first that is fine enough


def surface_heights(surface: Surface) -> bytes:
    """The heights of a mesh that is ground, packed. Raises Unusable for any other."""
    # Loaded late, as scipy is everywhere.
    from scipy.interpolate import LinearNDInterpolator

    vertices, faces = surface
    low = vertices.min(axis=0)
    size = np.ptp(vertices, axis=0)
    corners = vertices[faces]
    covered = (
        np.abs(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])[:, 2]).sum()
        / 2
    )
    uneven = abs(covered / max(size[0] * size[1], 1e-12) - 1) > GAPS
    if uneven or size[:2].min() < LARGE or size[2] < LEVEL or len(faces) < FINE:
        raise Unusable("is no ground")
    interpolate = LinearNDInterpolator(vertices[:, :2], vertices[:, 2])
    checked = np.vstack([vertices, corners.mean(axis=1)])
    shares = np.clip((checked[:, :2] - low[:2]) / size[:2], EDGE, 1 - EDGE)
    for most in COUNTS:
        counts = np.maximum(np.ceil(most * size[:2] / size[:2].max()).astype(int), 2)
        x, y = (np.linspace(EDGE, 1 - EDGE, count) for count in counts)
        # With more threads its many small equations take up to a hundred times as long.
        with threadpool_limits(1):
            heights = interpolate(low[0] + x * size[0], low[1] + y[:, None] * size[1])
        columns, rows = (shares * (counts - 1)).T
        if np.abs(bilinear(heights, rows, columns) - checked[:, 2]).max() <= OFF:
            return pack_heights(np.clip((heights - low[2]) / size[2], 0.0, 1.0))
    raise Unusable("is too rough for a grid of heights")
