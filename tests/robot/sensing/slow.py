"""Casting beams the slow way: along a beam, how far a point is outside of a convex shape first falls and then grows."""

from __future__ import annotations

import numpy as np
from scipy.spatial import ConvexHull

from ddenv.world.model import Box, Capsule, Cylinder, Ellipsoid, Mesh, Plane, Shape, Sphere
from ddenv.world.pose import Pose

# Each leaves two thirds of the way, or half of it.
STEPS = 80


def outside(shape: Shape, points: np.ndarray) -> np.ndarray:
    """How far (N,) `points` (N, 3) in the shape's frame are outside: 0 on the surface, below 0 inside, convex; no distance."""
    x, y, z = points.T
    match shape:
        case Box(size):
            return (np.abs(points) - np.array(size) / 2).max(axis=1)
        case Sphere(radius):
            return np.linalg.norm(points, axis=1) - radius
        case Ellipsoid(radii):
            return np.linalg.norm(points / np.array(radii), axis=1) - 1.0
        case Cylinder(radius, length):
            return np.maximum(np.hypot(x, y) - radius, np.abs(z) - length / 2)
        case Capsule(radius, length):
            return np.linalg.norm([x, y, np.maximum(np.abs(z) - length / 2, 0.0)], axis=0) - radius
        case Plane():
            return z
        case Mesh():
            faces = ConvexHull(shape.vertices).equations
            return (points @ faces[:, :3].T + faces[:, 3]).max(axis=1)


def first_met(
    shape: Shape, pose: Pose, origin: np.ndarray, ways: np.ndarray, farthest: float
) -> tuple[np.ndarray, np.ndarray]:
    """How far (N,) beams from `origin` along `ways` (N, 3) go until `shape` at `pose`, and how clear that is (N,).

    Infinite for those that miss it, and where `origin` is inside. It is clear by how deep a beam gets into the shape, or by how
    far it stays outside.
    """
    turn = pose.rotation()
    start, ways = (origin - pose.position) @ turn, ways @ turn

    def at(way: np.ndarray) -> np.ndarray:
        return outside(shape, start + way[:, None] * ways)

    low, high = np.zeros(len(ways)), np.full(len(ways), farthest)
    for _ in range(STEPS):
        third = (high - low) / 3
        falls = at(low + third) > at(high - third)
        low, high = np.where(falls, low + third, low), np.where(falls, high, high - third)
    deepest, depth = low, at(low)
    low, high = np.zeros(len(ways)), deepest
    for _ in range(STEPS):
        middle = (low + high) / 2
        in_it = at(middle) <= 0
        low, high = np.where(in_it, low, middle), np.where(in_it, middle, high)
    begins = at(np.zeros(len(ways)))
    return np.where((depth <= 0) & (begins > 0), high, np.inf), np.minimum(np.abs(depth), np.abs(begins))
