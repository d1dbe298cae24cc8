"""What a model looks like from above: the convex outlines of its collision shapes, in the world's x and y, m."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ddenv.world.model import Box, Collision, Cylinder, Model, Plane, Sphere, World, is_ground

# Corners that stand for a circle.
ROUND = 12
_CIRCLE = np.array([[math.cos(a), math.sin(a)] for a in np.linspace(0, 2 * math.pi, ROUND, endpoint=False)])
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


def footprints(world: World) -> tuple[Footprint, ...]:
    """Footprints of all models but the ground, the largest first, so that small ones can be drawn on top."""
    prints = [footprint(model) for model in world.models if not is_ground(model)]
    return tuple(sorted(prints, key=lambda each: -each.area))


def footprint(model: Model) -> Footprint:
    """Where `model` stands; one without collision shapes is a point."""
    outlines = [_outline(collision) for collision in model.collisions if not isinstance(collision.shape, Plane)]
    polygons = tuple(hull for hull in outlines if len(hull))
    points = np.vstack(polygons) if polygons else np.array([model.pose.position[:2]])
    low, high = points.min(axis=0), points.max(axis=0)
    return Footprint(model.name, polygons, (float(low[0]), float(low[1])), (float(high[0]), float(high[1])))


def _outline(collision: Collision) -> np.ndarray:
    shape, pose = collision.shape, collision.pose
    center = np.array(pose.position[:2])
    if isinstance(shape, Sphere):
        return center + shape.radius * _CIRCLE
    if isinstance(shape, Box):
        corners = _CUBE * shape.size
    else:
        assert isinstance(shape, Cylinder)
        rim = shape.radius * _CIRCLE
        half = np.full((ROUND, 1), shape.length / 2)
        corners = np.vstack([np.hstack([rim, half]), np.hstack([rim, -half])])
    return convex_hull(center + (corners @ pose.rotation().T)[:, :2])


def convex_hull(points: np.ndarray) -> np.ndarray:
    """The corners of the convex hull of (N, 2) points, anticlockwise (Andrew's monotone chain)."""
    ordered = sorted({(round(float(x), 6), round(float(y), 6)) for x, y in points})
    if len(ordered) < 3:
        return np.array(ordered)
    lower, upper = _chain(ordered), _chain(ordered[::-1])
    return np.array(lower[:-1] + upper[:-1])


def _chain(points: list[tuple[float, float]]) -> list[tuple[float, float]]:
    chain: list[tuple[float, float]] = []
    for point in points:
        while len(chain) > 1 and _turn(chain[-2], chain[-1], point) <= 0:
            chain.pop()
        chain.append(point)
    return chain


def _turn(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float]) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
