"""What a lidar can meet in a world, as arrays.

Each shape has a frame of its own in which it is between -1 and 1 along each axis: there all boxes are the same cube, and all
spheres and ellipsoids the same ball.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ddenv.robot.drake.articulation import anchored
from ddenv.robot.sensing.crossing import Facets
from ddenv.world.model import Box, Capsule, Cylinder, Ellipsoid, Mesh, Model, Plane, Shape, Sphere, World
from ddenv.world.pose import Pose, Vector

# The kinds of shapes that are cast in the same way, in the order in which they are sorted.
CUBE, BALL, TUBE, PILL, HULL = KINDS = range(5)
# A plane is the top of a cube of this size, m: what is below it is inside.
PLANE = 2e4
# Half the thickness of what has none, m.
THINNEST = 1e-9


@dataclass(frozen=True)
class Obstacles:
    """All collision shapes of a world, N of them, sorted by kind.

    `names` are the world's models, `owners` (N,) the number of each shape's model there. `links` (N,) is the number of the
    shape's link in its model, -1 where that never moves. `centers` (3, N) m and `turns` (3, 3, N) are the places of the shapes'
    frames, in the frame of the link or, of what never moves, in the world, and `halves` (3, N) m are half their
    sizes. `lengths` (N,) is half that of a capsule, for a radius of 1. `facets` has the faces of meshes by their numbers.
    """

    names: tuple[str, ...]
    owners: np.ndarray
    links: np.ndarray
    kinds: np.ndarray
    centers: np.ndarray
    turns: np.ndarray
    halves: np.ndarray
    lengths: np.ndarray
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
    """A model's shapes, each with the number of its link, or -1 if that never moves, and where it is in that link or the world."""
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
