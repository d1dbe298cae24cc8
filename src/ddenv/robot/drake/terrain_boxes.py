"""The boxes that stand for terrain: Drake computes the contact of a wheel's spheres with boxes exactly, unlike with triangles.

The grid is halved until a plane is near enough to each part; a box lies below that plane, tilted like it. So level ground is one
box. What stands for a part does not depend on which other parts are wanted.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import islice

import numpy as np

from ddenv.arrays import Floats
from ddenv.robot.drake.region import Region
from ddenv.world.model import Box, Collision, Model, Terrain
from ddenv.world.pose import Pose, pointing, vector
from ddenv.world.terrain import bilinear, height_at

# How far the surface may be from the boxes, m: the first of these with which at most `MOST` boxes stand around the robot's way, or
# the last. More boxes would take too much memory.
TOLERANCES = tuple(0.01 * 2 ** (number / 2) for number in range(16))
MOST = 1200
FINEST = 1 / 16  # the width of the smallest part, in cells of the grid
# A box is as thick as fits below the surface, m.
THICKEST, THINNEST = 1.0, 0.05
SIDES = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])


def with_boxes(model: Model, region: Region | None, way: Region) -> Model:
    """A model with boxes in place of terrain, those that reach into `region`; all if it is None.

    How coarse they are follows from the robot's `way` alone.
    """
    links = [
        replace(link, collisions=tuple(part for one in link.collisions for part in _parts(one, region, way)))
        for link in model.links
    ]
    return replace(model, links=tuple(links))


def _parts(collision: Collision, region: Region | None, way: Region) -> list[Collision]:
    terrain = collision.shape
    if not isinstance(terrain, Terrain):
        return [collision]
    for tolerance in TOLERANCES:
        if len(list(islice(boxes(terrain, collision.pose, way, tolerance), MOST + 1))) <= MOST:
            break
    return [replace(collision, shape=box, pose=pose) for box, pose in boxes(terrain, collision.pose, region, tolerance)]


def boxes(terrain: Terrain, place: Pose, region: Region | None, tolerance: float) -> Iterator[tuple[Box, Pose]]:
    """The boxes, no farther than `tolerance` (m) from the surface of terrain at `place`, that reach into `region`."""
    cells = np.array(terrain.heights.shape[::-1]) - 1.0
    step = np.array(terrain.size) / cells
    # The lowest and the highest corner of each part, in cells of the grid.
    waiting = [(np.zeros(2), cells)]
    while waiting:
        low, high = waiting.pop()
        middle = (low + high - cells) / 2 * step
        half = (high - low) / 2 * step
        x, y, _ = (place @ Pose((*middle.tolist(), 0.0))).position
        if region is not None and not region.reaches((x, y), float(np.linalg.norm(half))):
            continue
        columns, rows = (np.linspace(a, b, max(2, round(b - a) + 1)) for a, b in zip(low, high, strict=True))
        finest = (high - low).max() <= FINEST
        heights = bilinear(terrain.heights, rows[:, None], columns)
        found = _box(terrain, heights, middle, half, np.inf if finest else tolerance)
        if found is None:
            waiting += _halves(low, high, int(half.argmax()))
        else:
            yield found[0], place @ found[1]


def _halves(low: Floats, high: Floats, axis: int) -> list[tuple[Floats, Floats]]:
    """Both halves of a part along an axis, cut between two cells where there are several."""
    middle = (low[axis] + high[axis]) / 2
    if high[axis] - low[axis] > 1:
        middle = np.floor(middle)
    ends, starts = high.copy(), low.copy()
    ends[axis] = starts[axis] = middle
    return [(low, ends), (starts, high)]


def _box(terrain: Terrain, heights: Floats, middle: Floats, half: Floats, tolerance: float) -> tuple[Box, Pose] | None:
    """The box below the plane that is nearest to `heights` (R, C) m of a part; None if they are farther than `tolerance` (m).

    The part has its `middle` (2,) m in the frame of the terrain, and `half` the size (2,) m.
    """
    y, x = (np.linspace(-end, end, count) for end, count in zip(half[::-1], heights.shape, strict=True))
    slope = np.array(
        [(heights.mean(axis=0) * x).sum() / (x * x).sum(), (heights.mean(axis=1) * y).sum() / (y * y).sum()]
    )
    rest = heights - slope[0] * x - slope[1] * y[:, None]
    if rest.max() - rest.min() > 2 * tolerance:
        return None
    normal = np.append(-slope, 1.0) / np.sqrt(1 + slope[0] ** 2 + slope[1] ** 2)
    turn = pointing(vector(normal))
    axes = turn.rotation()
    # The box covers the corners of the part on the plane.
    corners = SIDES * half
    reach = np.abs(np.column_stack([corners, (corners * slope).sum(axis=1)]) @ axes).max(axis=0)[:2]
    top = np.append(middle, (rest.max() + rest.min()) / 2)
    rim = (SIDES * reach) @ axes[:, :2].T + top
    # On a slope it reaches farther than the part: it must not rise above the neighbours.
    if (_above(terrain, rim) > tolerance).any():
        return None
    thickness = THICKEST
    while thickness > THINNEST and (_above(terrain, rim - thickness * normal) > 0).any():
        thickness /= 2
    return Box(vector([*(2 * reach), thickness])), Pose(vector(top - thickness / 2 * normal), turn.quaternion)


def _above(terrain: Terrain, places: Floats) -> Floats:
    """How high `places` (N, 3) m are above the surface, m."""
    return places[:, 2] - height_at(terrain, places[:, 0], places[:, 1])
