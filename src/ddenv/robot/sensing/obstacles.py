"""The collision shapes that a lidar can hit, as arrays.

Each shape has its own frame, in which it lies between -1 and 1 along each axis: there all boxes are the same cube, and all spheres
and ellipsoids the same ball.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ddenv.arrays import Floats, Integers
from ddenv.robot.drake.articulation import anchored
from ddenv.robot.sensing.crossing import Facets
from ddenv.world.model import Box, Capsule, Cylinder, Ellipsoid, Mesh, Model, Plane, Shape, Sphere, World
from ddenv.world.pose import Pose, Vector

# The kinds of shapes that are cast in the same way, in the order in which they are sorted.
CUBE, BALL, TUBE, PILL, HULL = KINDS = range(5)
# A plane is the top of a cube of this size, m: what lies below it is inside.
PLANE = 2e4
# The minimum half thickness of a shape, m.
THINNEST = 1e-9


@dataclass(frozen=True)
class Obstacles:
    """All N collision shapes of a world, sorted by kind.

    `names` are the world's models, `owners` (N,) the index of each shape's model in `names`. `links` (N,) is the index of the
    shape's link in its model, -1 for a shape that never moves. `centers` (3, N) m and `turns` (3, 3, N) are the poses of the
    shapes' frames: in the link's frame, or in the world frame for a shape that never moves. `halves` (3, N) m are half the
    sizes. `lengths` (N,) are half lengths in units of the radius, for capsules. `facets` are the faces of meshes by
    the number of the shape.
    """

    names: tuple[str, ...]
    owners: Integers
    links: Integers
    kinds: Integers
    centers: Floats
    turns: Floats
    halves: Floats
    lengths: Floats
    facets: dict[int, Facets]

    @classmethod
    def of(cls, world: World) -> Obstacles:
        found = [(owner, *one) for owner, model in enumerate(world.models) for one in _shapes(model)]
        found.sort(key=lambda one: _kind(one[2]))
        owners, links, shapes, poses = zip(*found, strict=True) if found else ((), (), (), ())
        halves = np.maximum(np.array([_extent(shape)[1] for shape in shapes]).reshape(-1, 3), THINNEST)
        return cls(
            names=tuple(model.name for model in world.models),
            owners=np.array(owners, dtype=int),
            links=np.array(links, dtype=int),
            kinds=np.array([_kind(shape) for shape in shapes], dtype=int),
            centers=np.array([pose.position for pose in poses]).reshape(-1, 3).T.copy(),
            turns=np.array([pose.rotation() for pose in poses]).reshape(-1, 3, 3).transpose(1, 2, 0).copy(),
            halves=halves.T.copy(),
            lengths=halves[:, 2] / halves[:, 0],
            facets={
                number: Facets.of(shape, np.array(_extent(shape)[0]), halves[number])
                for number, shape in enumerate(shapes)
                if isinstance(shape, Mesh)
            },
        )


def _shapes(model: Model) -> list[tuple[int, Shape, Pose]]:
    """A model's shapes: the index of the link (-1 if it never moves), the shape, and its pose in the link or in the world."""
    held = {link.name for link in model.links} if model.static else anchored(model)
    found = []
    for number, link in enumerate(model.links):
        fixed = link.name in held
        frame = Pose() if fixed else link.pose.inverse()
        for one in link.collisions:
            found.append((-1 if fixed else number, one.shape, frame @ one.pose @ Pose(_extent(one.shape)[0])))
    return found


def _kind(shape: Shape) -> int:
    match shape:
        case Box() | Plane():
            return CUBE
        case Sphere() | Ellipsoid():
            return BALL
        case Cylinder():
            return TUBE
        case Capsule():
            return PILL
        case Mesh():
            return HULL
    raise TypeError(type(shape).__name__)


def _extent(shape: Shape) -> tuple[Vector, Vector]:
    """Of the box around `shape` along its own axes: the middle, and half the size, m."""
    middle: Vector = (0.0, 0.0, 0.0)
    match shape:
        case Box((x, y, z)):
            return middle, (x / 2, y / 2, z / 2)
        case Plane():
            return (0.0, 0.0, -PLANE / 2), (PLANE / 2, PLANE / 2, PLANE / 2)
        case Sphere(radius):
            return middle, (radius, radius, radius)
        case Ellipsoid(radii):
            return middle, radii
        case Cylinder(radius, length):
            return middle, (radius, radius, length / 2)
        case Capsule(radius, length):
            return middle, (radius, radius, length / 2 + radius)
        case Mesh():
            low, high = shape.vertices.min(axis=0), shape.vertices.max(axis=0)
            return tuple(((low + high) / 2).tolist()), tuple(((high - low) / 2).tolist())
    raise TypeError(type(shape).__name__)
