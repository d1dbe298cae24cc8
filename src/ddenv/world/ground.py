"""Replaces infinite planes by large boxes.

Drake crashes with half spaces among hundreds of boxes, and on the bodies that its parser makes of static models (drake#19263).
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from itertools import product

import numpy as np

from ddenv.world.extent import model_bounds
from ddenv.world.model import ENDLESS, Box, Collision, Model, Plane, World
from ddenv.world.pose import Pose, Vector

DEPTH = 1.0  # of the box, m
BEYOND = 20.0  # minimum width of ground beyond all models, m


def with_ground_boxes(world: World, places: Iterable[Vector] = ()) -> World:
    """`world` with a box for each plane, wide enough for all models and `places` (m, world frame)."""
    if not any(isinstance(one.shape, Plane) for model in world.models for one in model.collisions):
        return world
    boxes = [box for box in map(model_bounds, world.models) if box is not None]
    corners = [corner for low, high in boxes for corner in product(*zip(low, high, strict=True))]
    points = np.array([*corners, *places], dtype=float).reshape(-1, 3)
    return replace(world, models=tuple(_boxed(model, points) for model in world.models))


def _boxed(model: Model, points: np.ndarray) -> Model:
    links = (replace(link, collisions=tuple(_box(one, points) for one in link.collisions)) for link in model.links)
    return replace(model, links=tuple(links))


def _box(collision: Collision, points: np.ndarray) -> Collision:
    if not isinstance(collision.shape, Plane):
        return collision
    back = collision.pose.inverse()
    flat = (points @ back.rotation().T + back.position)[:, :2]
    if not len(flat) or np.abs(flat).max() <= ENDLESS / 2 - BEYOND:
        size, middle = (ENDLESS, ENDLESS), (0.0, 0.0)
    else:
        low, high = flat.min(axis=0), flat.max(axis=0)
        size = tuple((np.maximum(high - low, 0.0) + ENDLESS).tolist())
        middle = tuple(((low + high) / 2).tolist())
    place = Pose((middle[0], middle[1], -DEPTH / 2))
    return replace(collision, shape=Box((size[0], size[1], DEPTH)), pose=collision.pose @ place)
