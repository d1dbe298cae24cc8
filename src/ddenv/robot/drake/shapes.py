"""Collision shapes in Drake, their surfaces, and the small spheres on which moving models rest."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import count
from typing import Any

import numpy as np
from pydrake import geometry as drake
from pydrake.common.eigen_geometry import Quaternion
from pydrake.math import RigidTransform
from pydrake.multibody.plant import CoulombFriction

from ddenv.arrays import Floats
from ddenv.robot.drake.contact_shapes import contact_shapes, turning_joints
from ddenv.world.drive import Drive, wheel_links
from ddenv.world.hull import outermost
from ddenv.world.model import (
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Link,
    Mesh,
    Model,
    Shape,
    Sphere,
)
from ddenv.world.pose import Pose, Vector

# The contact of two surfaces is as stiff as both in series. Drake would derive it from the masses
# in the world, and removing a model would change the contacts of all others; here it follows from
# the model's own mass. On a single contact no model sinks by more than `SINK`, and none is softer
# than `SOFTEST`. What never moves is rigid.
SINK = 4e-3  # m
SOFTEST = 1e5  # N/m
RIGID = 1e12  # N/m
GRAVITY = 9.81  # m/s^2, whatever the world's is
# Hunt-Crossley dissipation, s/m. Wheels have less: it makes each of their spheres push as it comes,
# but grip only a step later.
DISSIPATION = 5.0
WHEEL_DISSIPATION = 0.5


def stiffness(model: Model) -> float:
    """The stiffness of the surfaces of `model`, N/m."""
    if model.static:
        return RIGID
    mass = sum(link.inertia.mass for link in model.links if link.inertia is not None)
    return max(SOFTEST, mass * GRAVITY / SINK)


def to_drake(array: Floats) -> Any:
    """`array` itself: pydrake's type stubs declare arrays in a form that no NumPy array matches."""
    return array


def transform(pose: Pose) -> RigidTransform:
    """`pose` as Drake's transform."""
    return RigidTransform(
        Quaternion(to_drake(np.array(pose.quaternion))), to_drake(np.array(pose.position))
    )


def wheel_friction(robot: Model, drive: Drive) -> float:
    """The friction coefficient of the robot's driven wheels; the largest if they differ."""
    links = [
        link
        for joint in robot.joints
        if joint.name in drive.joints
        for link in wheel_links(robot, joint)
    ]
    return max((one.mu for link in links for one in link.collisions), default=0.0)


def world_friction(mu: float, wheels: float) -> float:
    """The friction coefficient of a surface of the world in Drake, so that the robot's wheels grip
    it as in Gazebo.

    Gazebo's ODE takes the smaller of two surfaces' coefficients, m = min(mu, wheels). Drake
    combines a and b as 2 a b / (a + b), which is m for b = wheels and 1 / a = 2 / m - 1 / b. The
    user guide says what that makes of other contacts.
    """
    grip = min(mu, wheels)
    if grip > 0.0:
        return 1.0 / (2.0 / grip - 1.0 / wheels)
    return 0.0


def surface(
    mu: float, stiffness: float, dissipation: float = DISSIPATION
) -> drake.ProximityProperties:
    """A surface with Drake's friction coefficient `mu`, its `stiffness` (N/m) and `dissipation`
    (s/m).

    Static and dynamic friction are equal: with a difference, wheels stick and slip at the rate of
    the time steps.
    """
    properties = drake.ProximityProperties()
    drake.AddContactMaterial(dissipation, stiffness, CoulombFriction(mu, mu), properties)
    return properties


@dataclass(frozen=True, slots=True)
class Solid:
    """A shape in Drake with its `pose` in the world, as the model starts; `touches` is that of
    `Placed`.
    """

    shape: drake.Shape
    pose: Pose
    surface: drake.ProximityProperties
    touches: str = "all"


def link_solids(model: Model, link: Link, wheels: float | None, corners: bool) -> list[Solid]:
    """What stands in Drake for the collisions of a link of the world, or (`wheels` is None) of the
    robot.

    `wheels` is the robot's `wheel_friction`. With `corners` each collision also gets small spheres
    to rest on: a face that rests on a single contact point would creep.
    """
    dissipation = WHEEL_DISSIPATION if turning_joints(model, link) else DISSIPATION
    rests = resting_corners(link.collisions) if corners else [[]] * len(link.collisions)
    solids: list[Solid] = []
    parts_of = contact_shapes(model, link, robot=wheels is None)
    for collision, parts, places in zip(link.collisions, parts_of, rests, strict=True):
        mu = collision.mu if wheels is None else world_friction(collision.mu, wheels)
        properties = surface(mu, stiffness(model), dissipation)
        solids += [
            Solid(drake_shape(one.shape), one.pose, properties, one.touches) for one in parts
        ]
        corner = drake.Sphere(CORNER_RADIUS)
        solids += [Solid(corner, collision.pose @ Pose(place), properties) for place in places]
    return solids


CORNER_RADIUS = 0.002  # m
MOST_CORNERS = 64  # a link with more corners rests on the outermost ones alone
# Around a cylinder's rim, and on a convex mesh at most.
RIM_CORNERS = 8
MESH_CORNERS = 32


def resting_corners(collisions: Sequence[Collision]) -> list[list[Vector]]:
    """For each of the collisions of a link the corners on which the link can rest, in the frame of
    its shape, m.

    Of many corners these are the outermost: Drake takes time for each pair of shapes when it builds
    a plant.
    """
    corners = [corners_of(collision.shape) for collision in collisions]
    if sum(map(len, corners)) <= MOST_CORNERS:
        return corners
    pairs = zip(collisions, corners, strict=True)
    places = np.array(
        [(each.pose @ Pose(corner)).position for each, found in pairs for corner in found]
    )
    try:
        chosen = set(outermost(places).tolist())
    except ValueError:
        # All in one plane.
        return corners
    numbers = count()
    return [[corner for corner in found if next(numbers) in chosen] for found in corners]


def drake_shape(shape: Shape) -> drake.Shape:
    """`shape` as Drake's own. Raises ValueError for a shape that cannot be simulated."""
    match shape:
        case Box(size):
            return drake.Box(*size)
        case Cylinder(radius, length):
            return drake.Cylinder(radius, length)
        case Sphere(radius):
            return drake.Sphere(radius)
        case Capsule(radius, length):
            return drake.Capsule(radius, length)
        case Ellipsoid(radii):
            return drake.Ellipsoid(*radii)
        case Mesh(origin, vertices):
            return drake.Convex(
                points=to_drake(np.asfortranarray(vertices.T, dtype=float)), label=origin
            )
    raise ValueError(f"{type(shape).__name__} cannot be simulated")


def corners_of(shape: Shape) -> list[Vector]:
    """The centres of spheres just inside the corners of `shape`, in its frame, m; none for a shape
    without flat faces.
    """
    match shape:
        case Box(size):
            x, y, z = (max(side / 2 - CORNER_RADIUS, 0.0) for side in size)
            return [(sx * x, sy * y, sz * z) for sx in (-1, 1) for sy in (-1, 1) for sz in (-1, 1)]
        case Cylinder(radius, length):
            inner = max(radius - CORNER_RADIUS, 0.0)
            height = max(length / 2 - CORNER_RADIUS, 0.0)
            angles = [math.tau * number / RIM_CORNERS for number in range(RIM_CORNERS)]
            return [
                (inner * math.cos(a), inner * math.sin(a), end * height)
                for end in (-1, 1)
                for a in angles
            ]
        case Mesh():
            return _mesh_corners(shape)
    return []


def _mesh_corners(mesh: Mesh) -> list[Vector]:
    """Up to `MESH_CORNERS` vertices of a convex mesh, far from each other, each moved inside the
    faces that meet there.
    """
    edges = mesh.vertices[mesh.faces[:, 1:]] - mesh.vertices[mesh.faces[:, :1]]
    normals = np.cross(edges[:, 0], edges[:, 1])
    areas = np.linalg.norm(normals, axis=1)
    faces = mesh.faces[areas > 0]
    normals = normals[areas > 0] / areas[areas > 0, None]
    used = np.unique(faces)
    points = mesh.vertices[used]
    middle = points.mean(axis=0)
    # The first, then always the one farthest from all chosen ones.
    taken = [0]
    distances = np.linalg.norm(points - points[0], axis=1)
    while len(taken) < min(MESH_CORNERS, len(points)):
        taken.append(int(distances.argmax()))
        distances = np.minimum(distances, np.linalg.norm(points - points[taken[-1]], axis=1))
    centers = []
    for number in used[taken]:
        vertex = mesh.vertices[number]
        around = normals[(faces == number).any(axis=1)]
        # At the sphere's radius behind each face; least squares where more than three faces meet.
        inward = -CORNER_RADIUS * np.linalg.lstsq(around, np.ones(len(around)), rcond=1e-3)[0]
        # At the tip of a needle this could lead beyond the middle.
        furthest = float(np.linalg.norm(middle - vertex))
        inward *= min(1.0, furthest / max(float(np.linalg.norm(inward)), 1e-12))
        x, y, z = (vertex + inward).tolist()
        centers.append((x, y, z))
    return centers
