"""The boxes that stand for terrain: Drake computes the contact of a wheel's spheres with boxes
exactly, unlike with triangles.

The grid is halved until a plane is near enough to each part; a box lies below that plane, tilted
like it. So level ground is one box. What stands for a part does not depend on which other parts are
wanted.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import replace
from itertools import islice

import numpy as np

from ddenv.arrays import Floats
from ddenv.robot.drake.region import Region
from ddenv.world.model import Box, Collision, Model, Terrain, World
from ddenv.world.pose import Pose, pointing, vector
from ddenv.world.scenario import Scenario
from ddenv.world.terrain import bilinear, height_at

# How far the surface may be from the boxes, m: the first of these with which at most `MOST` boxes
# stand around the robot's way, or the last. More boxes would take too much memory.
TOLERANCES = tuple(0.01 * 2 ** (number / 2) for number in range(16))
MOST = 1200
COARSE = 0.02  # boxes that are farther off are worth a note, m
FINEST = 1 / 16  # the width of the smallest part, in cells of the grid
THICKNESS = 0.2  # of a box, m
CORNERS = np.array([[1.0, 1.0], [1.0, -1.0], [-1.0, 1.0], [-1.0, -1.0]])


def has_terrain(model: Model) -> bool:
    """Whether a part of `model` is terrain."""
    return any(isinstance(one.shape, Terrain) for one in model.collisions)


def with_boxes(model: Model, region: Region | None, way: Region) -> Model:
    """A model with boxes in place of terrain, those that reach into `region`; all if it is None.

    How coarse they are follows from the robot's `way` alone.
    """
    links = [
        replace(
            link,
            collisions=tuple(part for one in link.collisions for part in _parts(one, region, way)),
        )
        for link in model.links
    ]
    return replace(model, links=tuple(links))


def _parts(collision: Collision, region: Region | None, way: Region) -> list[Collision]:
    terrain = collision.shape
    if not isinstance(terrain, Terrain):
        return [collision]
    tolerance = _tolerance(terrain, collision.pose, way)
    return [
        replace(collision, shape=box, pose=pose)
        for box, pose in boxes(terrain, collision.pose, region, tolerance)
    ]


def _tolerance(terrain: Terrain, place: Pose, way: Region) -> float:
    """How far the surface of terrain at `place` may be from its boxes, m."""
    for tolerance in TOLERANCES:
        if len(list(islice(boxes(terrain, place, way, tolerance), MOST + 1))) <= MOST:
            break
    return tolerance


def note_terrain(
    world: World, scenario: Scenario, among: Collection[str]
) -> Iterator[tuple[str, str]]:
    """Which ground, or terrain of `among`, is too fine for its boxes on the robot's way."""
    spawn = scenario.robot.spawn
    goal = scenario.goal
    way = Region.of((spawn.x, spawn.y), (goal.x, goal.y), ())
    there = world.ground.union(among)
    for model in (each for each in world.models if each.name in there):
        for one in model.collisions:
            if not isinstance(one.shape, Terrain):
                continue
            off = _tolerance(one.shape, one.pose, way)
            if off > COARSE:
                yield (
                    "terrain",
                    f"boxes in place of {model.name}, up to {off:.2f} m off its surface",
                )


def boxes(
    terrain: Terrain, place: Pose, region: Region | None, tolerance: float
) -> Iterator[tuple[Box, Pose]]:
    """The boxes, no farther than `tolerance` (m) from the surface of terrain at `place`, that reach
    into `region`.
    """
    cells = np.array(terrain.heights.shape[::-1]) - 1.0
    step = np.array(terrain.size) / cells
    # The lowest and the highest corner of each part, in cells of the grid.
    waiting = [(np.zeros(2), cells)]
    while waiting:
        low, high = waiting.pop()
        middle = (low + high - cells) / 2 * step
        half = (high - low) / 2 * step
        centre = place @ Pose((float(middle[0]), float(middle[1]), 0.0))
        if region is not None and not region.reaches(
            centre.position[:2], float(np.linalg.norm(half))
        ):
            continue
        finest = (high - low).max() <= FINEST
        found = _box(terrain, low, high, middle, half, np.inf if finest else tolerance)
        if found is not None:
            yield found[0], place @ found[1]
            continue
        axis = half.argmax()
        cut = (low[axis] + high[axis]) / 2
        # Between two cells, where there are several.
        if high[axis] - low[axis] > 1:
            cut = np.floor(cut)
        end_of_first = high.copy()
        end_of_first[axis] = cut
        start_of_second = low.copy()
        start_of_second[axis] = cut
        waiting += [(low, end_of_first), (start_of_second, high)]


def _box(
    terrain: Terrain, low: Floats, high: Floats, middle: Floats, half: Floats, tolerance: float
) -> tuple[Box, Pose] | None:
    """The box below the plane that is nearest to the part from `low` to `high` (2,) cells; None if
    it is too far away.

    The part has its `middle` (2,) m in the frame of the terrain, and `half` the size (2,) m.
    """
    columns, rows = (
        np.linspace(*ends, max(2, round(ends[1] - ends[0]) + 1))
        for ends in zip(low, high, strict=True)
    )
    heights = bilinear(terrain.heights, rows[:, None], columns)
    x, y = (
        np.linspace(-end, end, count) for end, count in zip(half, heights.shape[::-1], strict=True)
    )
    slope_x = (heights.mean(axis=0) * x).sum() / (x * x).sum()
    slope_y = (heights.mean(axis=1) * y).sum() / (y * y).sum()
    rest = heights - slope_x * x - slope_y * y[:, None]
    if rest.max() - rest.min() > 2 * tolerance:
        return None
    normal = np.array([-slope_x, -slope_y, 1.0]) / np.sqrt(1 + slope_x**2 + slope_y**2)
    turn = pointing(vector(normal))
    axes = turn.rotation()
    # The box covers the whole part: on a slope it reaches farther, but must not rise above the
    # neighbours.
    edges = np.array([[half[0], 0.0, half[0] * slope_x], [0.0, half[1], half[1] * slope_y]])
    reach = np.abs(edges @ axes[:, :2]).sum(axis=0)
    top = np.append(middle, (rest.max() + rest.min()) / 2)
    rim = (CORNERS * reach) @ axes[:, :2].T + top
    if (rim[:, 2] - height_at(terrain, rim[:, 0], rim[:, 1]) > tolerance).any():
        return None
    return Box(vector([*(2 * reach), THICKNESS])), Pose(
        vector(top - THICKNESS / 2 * normal), turn.quaternion
    )
