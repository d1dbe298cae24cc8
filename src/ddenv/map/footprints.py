"""What a model looks like from above: the convex outlines of its collision shapes, in the world's x and y, m."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

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
from ddenv.world.outline import convex_hull
from ddenv.world.pose import Pose

# Corners that stand for a circle on a map of characters.
ROUND = 12
_CUBE = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])


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


def _distance(polygon: np.ndarray, point: np.ndarray) -> float:
    sides, away = np.roll(polygon, -1, axis=0) - polygon, point - polygon
    if len(polygon) > 2 and (sides[:, 0] * away[:, 1] >= sides[:, 1] * away[:, 0]).all():
        return 0.0
    lengths = np.einsum("ij,ij->i", sides, sides)
    along = np.einsum("ij,ij->i", sides, away) / np.where(lengths > 0, lengths, 1.0)
    return float(np.linalg.norm(away - np.clip(along, 0.0, 1.0)[:, None] * sides, axis=1).min())


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
