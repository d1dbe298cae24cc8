"""The extent of shapes and models: boxes in the world frame, m, also in place of endless planes."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from itertools import product

import numpy as np

from ddenv.world.model import (
    ENDLESS,
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Link,
    Mesh,
    Model,
    Plane,
    Shape,
    Sphere,
    Terrain,
    World,
)
from ddenv.world.pose import HERE, Pose, Vector, vector

Bounds = tuple[np.ndarray, np.ndarray]


def shape_bounds(shape: Shape, pose: Pose) -> Bounds:
    """Lowest and highest corner, each shape (3,), of `shape` at `pose`. A plane has a place but no
    size.
    """
    center = np.array(pose.position)
    rotation = pose.rotation()
    up = np.abs(rotation[:, 2])
    match shape:
        case Mesh(_, vertices):
            points = vertices @ rotation.T + center
            return points.min(axis=0), points.max(axis=0)
        case Box(size):
            half = np.abs(rotation) @ np.array(size) / 2
        case Cylinder(radius, length):
            half = radius * np.sqrt(np.maximum(0.0, 1 - up**2)) + up * length / 2
        case Capsule(radius, length):
            half = radius + up * length / 2
        case Ellipsoid(radii):
            half = np.sqrt((rotation * radii) ** 2 @ np.ones(3))
        case Sphere(radius):
            half = np.full(3, radius)
        case Plane():
            half = np.zeros(3)
        case Terrain((length, width), heights):
            lowest = float(heights.min())
            highest = float(heights.max())
            place = pose @ Pose((0.0, 0.0, (lowest + highest) / 2))
            return shape_bounds(Box((length, width, highest - lowest)), place)
    return center - half, center + half


# Sides of the prism that stands for a cylinder, and meridians of the ball that stands for an
# ellipsoid.
SIDES = 16
_CUBE = np.array(list(product((-0.5, 0.5), repeat=3)))


def vertices_of(shape: Shape, sides: int = SIDES) -> tuple[np.ndarray, float]:
    """The vertices (N, 3) m of a shape other than ground in its own frame, and how much it is
    larger than their hull, m.
    """
    ends = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]])
    match shape:
        case Box(size):
            return _CUBE * size, 0.0
        case Cylinder(radius, length):
            rim = np.column_stack([circle(sides), np.zeros(sides)])
            return np.vstack([rim + end for end in ends]) * (radius, radius, length), 0.0
        case Sphere(radius):
            return np.zeros((1, 3)), radius
        case Capsule(radius, length):
            return ends * length, radius
        case Ellipsoid(radii):
            tilts = np.linspace(0.0, math.pi, sides // 2 + 1)[:, None]
            x, y = circle(sides).T
            ball = [np.sin(tilts) * x, np.sin(tilts) * y, np.cos(tilts) + 0.0 * x]
            return np.stack(ball, axis=-1).reshape(-1, 3) * radii, 0.0
        case Mesh(_, vertices):
            return vertices, 0.0
    raise TypeError(type(shape).__name__)


def circle(sides: int) -> np.ndarray:
    """Corners (N, 2) on the unit circle."""
    angles = np.arange(sides) * math.tau / sides
    return np.column_stack([np.cos(angles), np.sin(angles)])


def filled_bounds(collision: Collision) -> Bounds:
    """The box around what a shape fills: all that is below a plane or terrain, everything if a
    plane leans.
    """
    low, high = shape_bounds(collision.shape, collision.pose)
    if isinstance(collision.shape, Terrain):
        low[2] = -np.inf
    if not isinstance(collision.shape, Plane):
        return low, high
    low = np.full(3, -np.inf)
    high = np.full(3, np.inf)
    if collision.pose.rotation()[2, 2] > 1 - 1e-9:
        high[2] = collision.pose.position[2]
    return low, high


def stacked(boxes: Iterable[Bounds]) -> Bounds:
    """The lowest and the highest corners, (N, 3) m each, of N boxes."""
    pairs = list(boxes)
    return np.array([low for low, _ in pairs]).reshape(-1, 3), np.array(
        [high for _, high in pairs]
    ).reshape(-1, 3)


def around(boxes: Iterable[Bounds]) -> Bounds | None:
    """The box around all `boxes`; None if there are none."""
    low, high = stacked(boxes)
    if len(low):
        return (low.min(axis=0), high.max(axis=0))
    return None


def bounds(collisions: Iterable[Collision], frame: Pose = HERE) -> Bounds | None:
    """The box around all `collisions` except planes, along the axes of a frame in which the world
    is at `frame`.

    None if there are none.
    """
    return around(
        shape_bounds(one.shape, frame @ one.pose)
        for one in collisions
        if not isinstance(one.shape, Plane)
    )


def center(model: Model) -> Vector:
    """The centre of the box around a model, m, which may be far from its frame; the origin of its
    frame if it fills nothing.
    """
    box = model_bounds(model)
    if box is None:
        return model.pose.position
    return vector((box[0] + box[1]) / 2)


def model_bounds(model: Model) -> Bounds | None:
    """The box around a model's collisions; None for the ground and for models that nothing can
    touch.
    """
    return bounds(model.collisions)


def polygon_area(corners: np.ndarray) -> float:
    """The area of the polygon `corners` (N, 2), m^2; negative if it is clockwise."""
    if len(corners) < 3:
        return 0.0
    x, y = corners.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


DEPTH = 1.0  # of a box in place of a plane, m
BEYOND = 20.0  # minimum width of ground beyond all models, m


def corners(world: World) -> tuple[Vector, Vector] | None:
    """The lowest and the highest corner of the box around all models, m; None if there are none."""
    box = bounds(world.collisions)
    if box is None:
        return None
    return (vector(box[0]), vector(box[1]))


def with_ground_boxes(
    world: World, box: tuple[Vector, Vector] | None, places: Iterable[Vector] = ()
) -> World:
    """`world` with a box for each plane, wide enough for all between two corners and for `places`
    (m, world frame).

    Drake crashes with half spaces among hundreds of boxes, and on the bodies that its parser makes
    of static models (drake#19263).
    """
    if not any(isinstance(one.shape, Plane) for one in world.collisions):
        return world
    within = product(*zip(*box, strict=True)) if box else ()
    points = np.array([*within, *places], dtype=float).reshape(-1, 3)

    def boxed(link: Link) -> Link:
        return replace(link, collisions=tuple(_box(one, points) for one in link.collisions))

    models = (replace(model, links=tuple(map(boxed, model.links))) for model in world.models)
    return replace(world, models=tuple(models))


def _box(collision: Collision, points: np.ndarray) -> Collision:
    if not isinstance(collision.shape, Plane):
        return collision
    back = collision.pose.inverse()
    flat = (points @ back.rotation().T + back.position)[:, :2]
    low = np.zeros(2)
    high = np.zeros(2)
    if len(flat) and np.abs(flat).max() > ENDLESS / 2 - BEYOND:
        low = flat.min(axis=0)
        high = flat.max(axis=0)
    width, length = (np.maximum(high - low, 0.0) + ENDLESS).tolist()
    x, y = ((low + high) / 2).tolist()
    place = Pose((x, y, -DEPTH / 2))
    return replace(collision, shape=Box((width, length, DEPTH)), pose=collision.pose @ place)
