"""Shapes that are made of flat faces here: `<polyline>`, an outline in x and y extruded upwards, and `<cone>`."""

from __future__ import annotations

import hashlib
import math

import numpy as np

from ddenv.world.model import Mesh
from ddenv.world.outline import convex_hull, polygon_area
from ddenv.world.sdf.context import Context
from ddenv.world.sdf.xml import Element, complain, numbers

SIDES = 32


def read_polyline(geometry: Element, context: Context) -> Mesh:
    """The hull of all `<polyline>`s of a `<geometry>`, standing on its frame's origin. Raises UserError."""
    elements = geometry.findall("polyline")
    height = _height(elements[0])
    outlines = [np.array([numbers(point, 2) for point in element.findall("point")]) for element in elements]
    corners = convex_hull(np.vstack([outline.reshape(-1, 2) for outline in outlines]))
    if len(corners) < 3:
        raise complain(elements[0], "needs three <point>s that are not in one line")
    if np.abs(corners).max() > 1e6:
        raise complain(elements[0], "is larger than 1e+06 m")
    filled = abs(polygon_area(outlines[0]))
    if len(elements) > 1 or filled < 0.99 * polygon_area(corners):
        context.note("replaced", elements[0], "a polyline that is not convex, or has holes, by its convex hull")
    return prism(corners, height)


def _height(element: Element) -> float:
    child = element.find("height")
    height = 1.0 if child is None else numbers(child, 1)[0]
    if not 1e-6 <= height <= 1e6:
        raise complain(
            element if child is None else child, f"the height must be from 1e-06 to 1e+06 m, found {height:g}"
        )
    return height


def prism(corners: np.ndarray, height: float) -> Mesh:
    """The convex outline `corners` (N, 2), anticlockwise, extruded from z = 0 to `height`, m."""
    count = len(corners)
    low = np.column_stack([corners, np.zeros(count)])
    here, after = np.arange(count), np.roll(np.arange(count), -1)
    walls = [np.column_stack([here, after, after + count]), np.column_stack([here, after + count, here + count])]
    fan = np.column_stack([np.zeros(count - 2, dtype=int), np.arange(1, count - 1), np.arange(2, count)])
    faces = np.vstack([*walls, fan[:, ::-1], fan + count])
    # Equal outlines make equal meshes, wherever they stand.
    origin = f"polyline {hashlib.blake2b(corners.tobytes(), digest_size=8).hexdigest()} {height!r}"
    return Mesh(origin, np.vstack([low, low + np.array([0, 0, height])]), faces.astype(np.uint32))


def cone(radius: float, length: float) -> Mesh:
    """A cone about its frame's origin, its tip up, m; with 32 sides."""
    angles = np.arange(SIDES) * 2 * math.pi / SIDES
    rim = np.column_stack([radius * np.cos(angles), radius * np.sin(angles), np.full(SIDES, -length / 2)])
    here, after = np.arange(SIDES), np.roll(np.arange(SIDES), -1)
    walls = np.column_stack([here, after, np.full(SIDES, SIDES)])
    fan = np.column_stack([np.zeros(SIDES - 2, dtype=int), np.arange(1, SIDES - 1), np.arange(2, SIDES)])
    vertices = np.vstack([rim, [0.0, 0.0, length / 2]])
    return Mesh(f"cone {radius!r} {length!r}", vertices, np.vstack([walls, fan[:, ::-1]]).astype(np.uint32))
