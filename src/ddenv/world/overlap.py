"""How far two convex shapes overlap, or how far they are apart: by the hull of all differences between their points."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ddenv.world.model import Box, Capsule, Collision, Cylinder, Ellipsoid, Mesh, Shape, Sphere
from ddenv.world.pose import Pose

# Sides of the prism that stands for a cylinder, and meridians of the ball that stands for an ellipsoid.
SIDES = 16


@dataclass(frozen=True)
class Hull:
    """A convex body: the hull of `vertices` (N, 3) m, grown by `radius` m."""

    vertices: np.ndarray
    radius: float = 0.0

    def span(self, axes: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Lowest and highest coordinate along each unit vector of `axes`, shape (M, 3)."""
        along = axes @ self.vertices.T
        return along.min(axis=1) - self.radius, along.max(axis=1) + self.radius


def hull(collision: Collision, place: Pose | None = None) -> Hull:
    """The convex body of a collision shape other than a plane, moved by `place`."""
    pose = collision.pose if place is None else place @ collision.pose
    vertices, radius = _own(collision.shape)
    return Hull(vertices @ pose.rotation().T + pose.position, radius)


def overlap(a: Hull, b: Hull) -> float:
    """The shortest move that separates two convex bodies, m; 0 if they do not overlap."""
    # Loaded only when it is needed: views run without it.
    from scipy.spatial import ConvexHull, QhullError

    grown = a.radius + b.radius
    differences = _differences(a, b)
    if (differences.min(axis=0) > grown).any() or (differences.max(axis=0) < -grown).any():
        return 0.0
    try:
        depth = -float(ConvexHull(differences).equations[:, 3].max())
    except QhullError:
        # All in one plane: two segments, or points.
        depth = 0.0
    if depth > 0.0:
        return depth + grown
    return max(0.0, grown - distance(a, b)) if grown else 0.0


def distance(a: Hull, b: Hull) -> float:
    """The distance between the hulls of the vertices, m; 0 if they touch."""
    from scipy.optimize import nnls

    differences = _differences(a, b)
    # Of all weighted means of the differences the one nearest to zero: least squares with a row that asks for a sum of 1.
    weights, _ = nnls(np.vstack([differences.T, np.ones(len(differences))]), np.array([0.0, 0.0, 0.0, 1.0]))
    return float(np.linalg.norm(weights @ differences)) / float(weights.sum())


def _differences(a: Hull, b: Hull) -> np.ndarray:
    return np.asarray((a.vertices[:, None] - b.vertices).reshape(-1, 3))


def _own(shape: Shape) -> tuple[np.ndarray, float]:
    """The vertices (N, 3) m of a shape in its own frame, and how much it is larger than their hull, m."""
    angles = np.arange(SIDES) * math.tau / SIDES
    ends = np.array([[0.0, 0.0, -0.5], [0.0, 0.0, 0.5]])
    match shape:
        case Box(size):
            return np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)]) * size, 0.0
        case Cylinder(radius, length):
            rim = np.column_stack([np.cos(angles), np.sin(angles), np.zeros(SIDES)])
            return np.vstack([rim + end for end in ends]) * (radius, radius, length), 0.0
        case Sphere(radius):
            return np.zeros((1, 3)), radius
        case Capsule(radius, length):
            return ends * length, radius
        case Ellipsoid(radii):
            tilts = np.linspace(0.0, math.pi, SIDES // 2 + 1)[:, None]
            ball = [np.sin(tilts) * np.cos(angles), np.sin(tilts) * np.sin(angles), np.cos(tilts) + 0.0 * angles]
            return np.stack(ball, axis=-1).reshape(-1, 3) * radii, 0.0
        case Mesh(_, vertices):
            return vertices, 0.0
    raise TypeError(type(shape).__name__)
