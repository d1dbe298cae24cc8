"""What a model looks like from above: the convex outlines of its collision shapes, in the world's x and y, m."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from ddenv.map.paint import RGB
from ddenv.world.extent import convex_hull, model_bounds, shape_bounds
from ddenv.world.model import (
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Mesh,
    Model,
    Plane,
    Shape,
    Sphere,
    World,
    is_ground,
)
from ddenv.world.pose import Pose, Vector

# Corners that stand for a circle on a map of characters.
ROUND = 12
_CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
STATIC: RGB = (150, 156, 166)
DYNAMIC: RGB = (205, 140, 70)
# A model so many times larger than the median, and than this, is a floor that others stand on (or a roof over them).
FLOOR_FACTOR = 12.0
FLOOR_AREA = 4.0  # m^2


@dataclass(frozen=True, slots=True, eq=False)
class Footprint:
    """A model from above: convex `polygons`, each (N, 2) m and anticlockwise; `low` and `high` are its corners, m."""

    name: str
    polygons: tuple[np.ndarray, ...]
    low: tuple[float, float]
    high: tuple[float, float]

    @property
    def center(self) -> tuple[float, float]:
        return ((self.low[0] + self.high[0]) / 2, (self.low[1] + self.high[1]) / 2)

    @property
    def area(self) -> float:
        """Of the rectangle around it, m^2."""
        return (self.high[0] - self.low[0]) * (self.high[1] - self.low[1])

    def distance(self, point: tuple[float, float]) -> float:
        """From a point to the nearest polygon, m; 0 inside of one. Without polygons, to where the model is."""
        if not self.polygons:
            return math.dist(self.center, point)
        return min(_distance(polygon, np.array(point)) for polygon in self.polygons)


def footprints(world: World, corners: int = ROUND) -> tuple[Footprint, ...]:
    """Footprints of all models but the ground, the largest first, so that small ones can be drawn on top."""
    prints = [footprint(model, corners) for model in world.models if not is_ground(model)]
    return tuple(sorted(prints, key=lambda each: -each.area))


def footprint(model: Model, corners: int = ROUND) -> Footprint:
    """Where `model` stands; one without collision shapes is a point. Circles are polygons with so many `corners`."""
    outlines = [_outline(each, corners) for each in model.collisions if not isinstance(each.shape, Plane)]
    polygons = tuple(outline for outline in outlines if len(outline))
    points = np.vstack(polygons) if polygons else np.array([model.pose.position[:2]])
    low, high = points.min(axis=0), points.max(axis=0)
    return Footprint(model.name, polygons, (float(low[0]), float(low[1])), (float(high[0]), float(high[1])))


def _outline(collision: Collision, corners: int) -> np.ndarray:
    return convex_hull(_points(collision.shape, collision.pose, corners) + collision.pose.position[:2])


def _points(shape: Shape, pose: Pose, corners: int) -> np.ndarray:
    """Points (N, 2), relative to the shape's origin, whose convex hull is the shape seen from above."""
    circle, flat = _circle(corners), pose.rotation()[:2]
    match shape:
        case Sphere(radius):
            return radius * circle
        case Box(size):
            return _CUBE * size @ flat.T
        case Cylinder(radius, length):
            rim = radius * circle @ flat[:, :2].T
            end = flat[:, 2] * length / 2
            return np.vstack([rim + end, rim - end])
        case Capsule(radius, length):
            end = flat[:, 2] * length / 2
            return np.vstack([radius * circle + end, radius * circle - end])
        case Ellipsoid(radii):
            return _ellipse(flat * radii, circle)
        case Mesh():
            return shape.vertices @ flat.T
    raise TypeError(type(shape).__name__)


def _circle(corners: int) -> np.ndarray:
    angles = np.linspace(0, math.tau, corners, endpoint=False)
    return np.column_stack([np.cos(angles), np.sin(angles)])


def _ellipse(half_axes: np.ndarray, circle: np.ndarray) -> np.ndarray:
    """The shadow of an ellipsoid, whose three half axes seen from above are the columns of `half_axes`."""
    directions, lengths, _ = np.linalg.svd(half_axes, full_matrices=False)
    return lengths * circle @ directions.T


def _distance(polygon: np.ndarray, point: np.ndarray) -> float:
    sides, away = np.roll(polygon, -1, axis=0) - polygon, point - polygon
    if len(polygon) > 2 and (sides[:, 0] * away[:, 1] >= sides[:, 1] * away[:, 0]).all():
        return 0.0
    lengths = np.einsum("ij,ij->i", sides, sides)
    along = np.einsum("ij,ij->i", sides, away) / np.where(lengths > 0, lengths, 1.0)
    return float(np.linalg.norm(away - np.clip(along, 0.0, 1.0)[:, None] * sides, axis=1).min())


@dataclass(frozen=True, slots=True)
class Drawn:
    """A model from above. `center` and `size` are those of the box around it, m; `shade` 0..1 tells low from high ones.

    `color` is the one that covers most of it, or one for its kind where the file names none.
    """

    model: Model
    outline: Footprint
    center: Vector
    size: Vector
    color: RGB
    floor: bool
    shade: float

    @property
    def top(self) -> float:
        """Height of the highest point, m."""
        return self.center[2] + self.size[2] / 2


def plan(world: World, corners: int = ROUND) -> tuple[Drawn, ...]:
    """All models but the ground: floors first, the largest of them first, then the others from the lowest top to the highest.

    Where tops are equal the larger comes first. Circles are polygons with so many `corners`.
    """
    models = [model for model in world.models if not is_ground(model)]
    outlines = [footprint(model, corners) for model in models]
    boxes = [_box(model) for model in models]
    tops = np.array([center[2] + size[2] / 2 for center, size in boxes])
    limit = max(FLOOR_AREA, FLOOR_FACTOR * float(np.median([each.area for each in outlines]))) if models else 0.0
    floors = [len(models) > 2 and each.area > limit for each in outlines]
    shades = _shades(tops, np.array(floors, dtype=bool))
    drawn = [
        Drawn(model, outline, *box, _color(model), floor, shade)
        for model, outline, box, floor, shade in zip(models, outlines, boxes, floors, shades, strict=True)
    ]
    return tuple(sorted(drawn, key=_turn))


def _turn(each: Drawn) -> tuple[int, float, float]:
    """Floors come first, and last what has no shape to be seen by; heights are told apart in steps of 1 cm."""
    group = 0 if each.floor else 1 if each.outline.polygons else 2
    return group, 0.0 if each.floor else round(each.top, 2), -each.outline.area


def _box(model: Model) -> tuple[Vector, Vector]:
    """Centre and size of what a model fills."""
    bounds = model_bounds(model)
    if bounds is None:
        return model.pose.position, (0.0, 0.0, 0.0)
    low, high = bounds
    return tuple(((low + high) / 2).tolist()), tuple((high - low).tolist())


def _shades(tops: np.ndarray, floors: np.ndarray) -> list[float]:
    """Heights between the lowest and the highest of the models that are no floors, as 0..1; 1 where all are as high."""
    others = tops[~floors]
    if not len(others) or np.ptp(others) < 0.01:
        return [1.0] * len(tops)
    return np.clip((tops - others.min()) / np.ptp(others), 0.0, 1.0).tolist()


def _color(model: Model) -> RGB:
    areas: dict[RGB, float] = defaultdict(float)
    for link in model.links:
        for visual in link.visuals:
            if visual.color is None or visual.color[3] <= 0 or isinstance(visual.shape, Plane):
                continue
            low, high = shape_bounds(visual.shape, visual.pose)
            red, green, blue = (round(255 * min(1.0, max(0.0, part))) for part in visual.color[:3])
            areas[red, green, blue] += float(np.prod((high - low)[:2]))
    if areas:
        return max(areas, key=areas.get)
    return STATIC if model.static else DYNAMIC
