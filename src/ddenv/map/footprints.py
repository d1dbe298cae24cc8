"""Models from above: the convex outlines of their collision shapes in the world's x and y, m, and
how they are drawn.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ddenv.map.colors import RGB
from ddenv.world.extent import (
    circle,
    filled_bounds,
    model_bounds,
    polygon_area,
    shape_bounds,
    vertices_of,
)
from ddenv.world.hull import convex_outline
from ddenv.world.model import Box, Model, Plane, Terrain, World
from ddenv.world.pose import HERE, Point, Pose, Vector, vector

# Corners of the polygon that stands for a circle on a character map.
ROUND = 12
STATIC: RGB = (150, 156, 166)
DYNAMIC: RGB = (205, 140, 70)
# A colour of which all parts are larger would not be seen on paper.
WHITE = 0.95
# A model is a floor if its area is `FLOOR_FACTOR` times the median, and at least `FLOOR_AREA`, and
# it is not `hollow`.
FLOOR_FACTOR = 12.0
FLOOR_AREA = 6.0  # m^2
# A model is hollow, like the walls of a building, if it covers less than this share of the
# rectangle around it.
HOLLOW = 0.5
# What hangs higher than this above the ground closes no door, m.
HEAD = 1.0


@dataclass(frozen=True, slots=True, eq=False)
class Footprint:
    """A model from above: convex `polygons`, each (N, 2) m and anticlockwise, and the corners `low`
    and `high` around them, m.
    """

    name: str
    polygons: tuple[np.ndarray, ...]
    low: Point
    high: Point

    @property
    def center(self) -> Point:
        return ((self.low[0] + self.high[0]) / 2, (self.low[1] + self.high[1]) / 2)

    @property
    def area(self) -> float:
        """The area of the rectangle around it, m^2."""
        return (self.high[0] - self.low[0]) * (self.high[1] - self.low[1])

    @property
    def covered(self) -> float:
        """The area of all its polygons, m^2."""
        return sum(map(polygon_area, self.polygons))

    @property
    def hollow(self) -> bool:
        return self.covered < HOLLOW * self.area

    def distance(self, point: Point) -> float:
        """The distance from a point to the nearest polygon, m; 0 inside. Without polygons, to the
        model's centre.
        """
        if not self.polygons:
            return math.dist(self.center, point)
        return min(_distance(polygon, np.array(point)) for polygon in self.polygons)


def footprints(world: World) -> tuple[Footprint, ...]:
    """Footprints of all models except the ground; those that cover most come first, so that small
    ones are drawn on top.
    """
    ground = ground_height(world)
    prints = [footprint(model, ground=ground) for model in without_ground(world)]
    # Equal models that are turned differ only by rounding: they stay in the file's order.
    return tuple(sorted(prints, key=lambda each: -round(each.covered, 6)))


def without_ground(world: World) -> list[Model]:
    """The models that are not the ground of all others."""
    ground = world.ground
    return [model for model in world.models if model.name not in ground]


def ground_height(world: World) -> float:
    """The height of the highest plane or large box, m; infinite without any: a mesh may be
    hills.
    """
    flat = [
        filled_bounds(one)
        for model in world.models
        for one in model.collisions
        if isinstance(one.shape, Plane | Box)
    ]
    tops = [float(high[2]) for low, high in flat if np.prod((high - low)[:2]) > FLOOR_AREA]
    return max(tops, default=math.inf)


def footprint(
    model: Model, corners: int = ROUND, moved: Pose = HERE, ground: float = math.inf
) -> Footprint:
    """The footprint of `model`; a point without collision shapes. Circles become polygons with
    `corners` corners.

    Pieces that begin more than `HEAD` above the `ground` (m), or else above its lowest point, are
    left out: the wall above a door. `moved` is how the model has moved as a whole since the world's
    file, in the world frame.
    """
    polygons = []
    pieces = [
        (each, shape_bounds(each.shape, moved @ each.pose)[0][2]) for each in model.collisions
    ]
    if math.isinf(ground):
        ground = min((foot for _, foot in pieces), default=0.0)
    for each, foot in pieces:
        hangs = foot > ground + HEAD and not isinstance(each.shape, Terrain)
        if not hangs and not isinstance(each.shape, Plane):
            pose = moved @ each.pose
            shape = Box((*each.shape.size, 0.0)) if isinstance(each.shape, Terrain) else each.shape
            vertices, radius = vertices_of(shape, corners)
            flat = vertices @ pose.rotation()[:2].T + pose.position[:2]
            around = (flat[:, None] + radius * circle(corners)).reshape(-1, 2) if radius else flat
            polygons += [outline] if len(outline := convex_outline(around)) else []
    points = np.vstack(polygons) if polygons else np.array([(moved @ model.pose).position[:2]])
    low = points.min(axis=0)
    high = points.max(axis=0)
    return Footprint(
        model.name,
        tuple(polygons),
        (float(low[0]), float(low[1])),
        (float(high[0]), float(high[1])),
    )


def rings(model: Model, moved: Pose) -> tuple[np.ndarray, ...]:
    """The outlines of a model that has `moved`, as closed lines (N, 2), m."""
    return tuple(np.vstack([each, each[:1]]) for each in footprint(model, moved=moved).polygons)


def _distance(polygon: np.ndarray, point: np.ndarray) -> float:
    sides = np.roll(polygon, -1, axis=0) - polygon
    away = point - polygon
    if len(polygon) > 2 and (sides[:, 0] * away[:, 1] >= sides[:, 1] * away[:, 0]).all():
        return 0.0
    lengths = np.einsum("ij,ij->i", sides, sides)
    along = np.einsum("ij,ij->i", sides, away) / np.where(lengths > 0, lengths, 1.0)
    return float(np.linalg.norm(away - np.clip(along, 0.0, 1.0)[:, None] * sides, axis=1).min())


@dataclass(frozen=True, slots=True, kw_only=True)
class Drawn:
    """A model to draw from above. `center` and `size` are of the box around it, m.

    `color` is that of its first visual, or the default of its kind if the file has none, or white,
    as meshes without one have.
    """

    model: Model
    outline: Footprint
    center: Vector
    size: Vector
    color: RGB
    floor: bool

    @property
    def top(self) -> float:
        """Height of the highest point, m."""
        return self.center[2] + self.size[2] / 2


def plan(world: World, corners: int = ROUND) -> tuple[Drawn, ...]:
    """All models except the ground in the order of drawing: floors, the largest first, then the
    others by height of their top.

    Of equal tops the larger model comes first. Circles become polygons with `corners` corners.
    """
    ground = ground_height(world)
    models = without_ground(world)
    outlines = [footprint(model, corners, ground=ground) for model in models]
    if models:
        limit = max(FLOOR_AREA, FLOOR_FACTOR * float(np.median([each.area for each in outlines])))
    else:
        limit = 0.0
    drawn = []
    for model, outline in zip(models, outlines, strict=True):
        center = model.pose.position
        size = (0.0, 0.0, 0.0)
        if (box := model_bounds(model)) is not None:
            center = vector((box[0] + box[1]) / 2)
            size = vector(box[1] - box[0])
        floor = len(models) > 2 and outline.area > limit and not outline.hollow
        drawn.append(
            Drawn(
                model=model,
                outline=outline,
                center=center,
                size=size,
                color=_color(model),
                floor=floor,
            )
        )
    return tuple(sorted(drawn, key=_turn))


def _turn(each: Drawn) -> tuple[int, float, float]:
    """The sort key: floors, then models with shapes, then those without; heights in steps of 1
    cm.
    """
    if each.floor:
        return 0, 0.0, -each.outline.area
    group = 1 if each.outline.polygons else 2
    return group, round(each.top, 2), -each.outline.area


def _color(model: Model) -> RGB:
    for visual in model.visuals:
        if visual.color is not None and visual.color[3] > 0 and not isinstance(visual.shape, Plane):
            if min(visual.color[:3]) > WHITE:
                break
            red, green, blue = (round(255 * min(1.0, max(0.0, part))) for part in visual.color[:3])
            return red, green, blue
    if model.static:
        return STATIC
    return DYNAMIC
