"""How wide the ways of a robot are, seen from above: whether it fits through the doors of a
building.

What blocks it is a step, up or down, that is higher than half the robot. So floors, carpets, low
lips, ramps and what they lead to do not block; nor do lintels and ceilings, since only pieces that
begin below the robot's top count, as filled below; nor does a trench, since what lies lower than
the start counts as filled; nor do models that can move.
"""

from __future__ import annotations

import math
from bisect import bisect_left
from dataclasses import dataclass

import numpy as np

from ddenv.arrays import Booleans, Floats
from ddenv.world.extent import shape_bounds, vertices_of
from ddenv.world.hull import half_spaces
from ddenv.world.model import Collision, Ellipsoid, Ground, World
from ddenv.world.pose import Point

# The width of a column, m, and about the maximum number of columns: in a large world they are
# wider.
CELL = 0.025
MOST = 500_000
# A way that is wider than this leads through no door, m.
DOOR = 1.5
# Space around all models, m: a start is moved less far.
MARGIN = 2.5
# Pieces that are so near to each other leave no gap, m.
GAP = 1e-4
# The least vertical part of the unit normal of a face: that of an upright one counts as this.
UPRIGHT = 1e-6
BALL = vertices_of(Ellipsoid((1.0, 1.0, 1.0)))[0]


@dataclass(frozen=True, slots=True, eq=False)
class Clearance:
    """Columns of the world, each `cell` (m) wide, with their `middles` (N, M, 2) m.

    `free` is how far each is from what blocks the robot, (N, M) m.
    """

    middles: Floats
    cell: float
    free: Floats

    def near(self, point: Point, distance: float) -> Booleans:
        """The columns (N, M) that are at most `distance` (m) from `point`; at least the one that it
        is in.
        """
        away = np.linalg.norm(self.middles - point, axis=2)
        return np.asarray(away <= max(distance, away.min()))

    def joined(self, width: float, places: Booleans) -> Booleans:
        """The columns (N, M) to which a way of this `width` (m) leads from one of the `places` (N,
        M).
        """
        from scipy.ndimage import label

        inside = self.free >= max(width, self.cell) / 2
        numbers, _ = label(inside)
        return np.asarray(inside & np.isin(numbers, numbers[inside & places]))

    def widest(self, places: Booleans, others: Booleans) -> float:
        """The width of the widest way from one of the `places` to one of the `others` (N, M), m; 0
        if there is none.
        """
        widths = np.unique(2 * self.free)[1:]
        number = bisect_left(
            widths, True, key=lambda width: not self.joined(width, places)[others].any()
        )
        # From middle to middle of two columns that block it is half a column farther, on average,
        # than what is free.
        if number:
            return float(widths[number - 1]) - self.cell / 2
        return 0.0

    def outdoors(self) -> Booleans:
        """The columns (N, M) that are reached from a corner of the world without going through a
        door.
        """
        open_ground = self.joined(DOOR, self.near(self.middles[0, 0], 0.0))
        return _distances(~open_ground) * self.cell <= DOOR / 2


def clearance(
    world: World, width: float, height: float, level: float, points: list[Point]
) -> Clearance:
    """The clearance around all models and `points` for a robot of this size that stands on the
    height `level`, all in m.
    """
    from scipy.ndimage import minimum_filter

    step = height / 2
    shapes = [one for model in world.models if model.static for one in model.collisions]
    boxes = [
        (one, *shape_bounds(one.shape, one.pose))
        for one in shapes
        if not isinstance(one.shape, Ground)
    ]
    boxes = [box for box in boxes if box[1][2] < level + height and box[2][2] > level + step]
    ends = np.array([*points, *(corner[:2] for _, *corners in boxes for corner in corners)])
    low = ends.min(axis=0) - MARGIN
    size = ends.max(axis=0) + MARGIN - low
    cell = max(CELL, math.sqrt(size[0] * size[1] / MOST))
    counts = np.ceil(size / cell).astype(int)
    middles = low + cell * np.moveaxis(np.indices(counts), 0, -1)
    tops = np.full(counts, level)
    for one, *corners in boxes:
        (i, j), (k, n) = ((np.array(corners)[:, :2] - low) / cell).astype(int)
        part = slice(i, k + 2), slice(j, n + 2)
        tops[part] = np.maximum(tops[part], _tops(one, middles[part], cell))
    blocked = tops - minimum_filter(tops, 3) > max(step, cell)
    return Clearance(middles, cell, _distances(~blocked) * cell)


def _distances(inside: Booleans) -> Floats:
    """How far it is to the nearest column that is not `inside`, in columns."""
    from scipy.ndimage import distance_transform_edt

    if inside.all():
        return np.full(inside.shape, math.inf)
    return np.asarray(distance_transform_edt(inside))


def _tops(one: Collision, middles: Floats, cell: float) -> Floats:
    """How high a shape is in columns (N, M), m: minus infinity where it is not."""
    corners, radius = vertices_of(one.shape)
    if radius:
        corners = (corners[:, None] + radius * BALL).reshape(-1, 3)
    corners = corners @ one.pose.rotation().T + one.pose.position
    tops = np.full(middles.shape[:2], math.inf)
    bottoms = -tops
    for *ahead, up, offset in half_spaces(corners, joggle=True):
        # What is thinner than a column must not vanish between the middles of two.
        thin = max(0.0, cell * math.hypot(*ahead) - np.ptp(corners[:, :2] @ ahead))
        rest = thin / 2 + GAP - offset - middles @ ahead
        if up < -UPRIGHT:
            bottoms = np.maximum(bottoms, rest / up)
        else:
            tops = np.minimum(tops, rest / max(up, UPRIGHT))
    return np.where(bottoms <= tops, tops, -math.inf)
