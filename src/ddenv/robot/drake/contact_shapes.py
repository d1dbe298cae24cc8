"""The boxes and spheres that stand for a collision, so that contacts are right at edges.

Drake computes the contact of a sphere with a box, and that of two boxes, exactly. Nearly all other
pairs go through a general solver that is wrong at edges: there its normal is the line between the
centres of the two shapes, so that a cylinder which rolls over a lip of 1 mm hits a wall, and the
longer the slab behind the lip, the steeper that wall. `benchmarks/contact_normals.py` measures each
pair. docs/contact.md says what stands for what.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np

from ddenv.arrays import Floats
from ddenv.robot.drake.mesh_pieces import pieces
from ddenv.world.extent import vertices_of
from ddenv.world.hull import convex_hull
from ddenv.world.model import (
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Joint,
    Link,
    Mesh,
    Model,
    Shape,
    Sphere,
    held_with,
    is_fixed,
)
from ddenv.world.pose import HERE, Pose, Vector, pointing, vector


class Placed(NamedTuple):
    """A shape at its `pose`, and which shapes can touch it: all, only spheres, or all but
    spheres.
    """

    shape: Shape
    pose: Pose
    touches: Literal["all", "spheres", "others"] = "all"


Kind = Literal["static", "robot", "loose"]

# How far a wheel may rise and fall as it rolls from sphere to sphere on a plane: this many m, and
# this share of its radius.
BUMP = 1e-3
BUMP_SHARE = 6e-3
# How far an edge may sink in between two spheres of a wheel, as a share of the wheel's radius.
DIP_SHARE = 0.012
# The spheres of a thin wheel have this share of its radius: smaller ones would leave gaps between
# them.
THINNEST = 1 / 12
MOST_SPHERES = 96  # of one ring
# How far the sides of a prism of boxes may lie from the cylinder that it stands for, m, and the
# number of its sides.
FLAT = 5e-3
FEWEST_SIDES = 16
MOST_SIDES = 96
FINE_SIDES = 32  # of a prism that is a single shape


def contact_shapes(model: Model, link: Link, robot: bool) -> list[list[Placed]]:
    """For each collision of a `link` what stands for it; the poses are in the world, as the model
    starts.

    With `robot` the model is the robot, no part of which rolls except its wheels.
    """
    axles = turning_joints(model, link)
    kind: Kind = "robot" if robot else "loose"
    if model.static:
        kind = "static"
    return [
        [part._replace(pose=collision.pose @ part.pose) for part in _parts(collision, axles, kind)]
        for collision in link.collisions
    ]


def turning_joints(model: Model, link: Link) -> tuple[Joint, ...]:
    """The joints of `model` that turn `link` about an axis: its axle if it is a wheel."""
    held = held_with(model, link.name)
    turning = (joint for joint in model.joints if joint.kind in ("revolute", "continuous"))
    return tuple(joint for joint in turning if joint.child in held and not is_fixed(joint))


def _parts(collision: Collision, axles: Sequence[Joint], kind: Kind) -> list[Placed]:
    for axle in axles:
        wheel = wheel_of(collision, axle)
        if wheel is not None:
            return tyre(wheel)
    match collision.shape:
        case Cylinder(radius, length):
            return cylinder(radius, length, kind)
        case Capsule(radius, length):
            if kind == "static":
                tube = cylinder(radius, length, kind)
            else:
                tube = prism(radius, length, rolls=True)
            return [
                *tube,
                *(Placed(Sphere(radius), Pose((0.0, 0.0, end * length / 2))) for end in (-1, 1)),
            ]
        case Mesh():
            return [
                placed
                for shape, pose in pieces(collision.shape)
                for placed in _piece(shape, pose, kind)
            ]
    return [Placed(collision.shape, HERE)]


def _piece(shape: Shape, pose: Pose, kind: Kind) -> list[Placed]:
    """What stands for a piece of a mesh at `pose` in the frame of the mesh."""
    if not isinstance(shape, Cylinder):
        return [Placed(shape, pose)]
    return [
        part._replace(pose=pose @ part.pose) for part in cylinder(shape.radius, shape.length, kind)
    ]


def cylinder(radius: float, length: float, kind: Kind) -> list[Placed]:
    """What stands for a cylinder along z.

    A sphere touches a cylinder exactly, and a box a prism nearly so: of what is static each sees
    its own. What moves must touch boxes of any length exactly, so it is made of boxes; between the
    edges of what rolls, spheres as wide as it touch the ground.
    """
    if kind == "static":
        return [
            Placed(Cylinder(radius, length), HERE, "spheres"),
            Placed(_fine_prism(radius, length), HERE, "others"),
        ]
    if kind == "robot":
        return prism(radius, length, rolls=False)
    width = min(length / 2, radius)
    ends = sorted({width - length / 2, length / 2 - width})
    return [
        *prism(radius, length, rolls=True),
        *(sphere for end in ends for sphere in ring(radius, width, end)),
    ]


def _fine_prism(radius: float, length: float) -> Mesh:
    points, _ = vertices_of(Cylinder(_mean_outer(radius, FINE_SIDES), length), FINE_SIDES)
    return Mesh(f"prism {radius} {length}", *convex_hull(points))


def _mean_outer(radius: float, sides: int) -> float:
    """The radius on which the corners of a prism lie whose sides are as far outside a cylinder as
    inside.
    """
    angle = math.pi / sides
    return radius * angle / math.sin(angle)


def prism(radius: float, length: float, rolls: bool) -> list[Placed]:
    """The boxes that together fill a prism in place of a cylinder along z.

    Each is as wide as one side of the prism, and reaches from there through the axis to the
    opposite side. The prism lies inside a cylinder that `rolls`; else its sides are as far outside
    the cylinder as inside.
    """
    needed = math.pi / math.acos(max(0.0, 1.0 - FLAT / radius))
    half = math.ceil(min(max(needed, FEWEST_SIDES), MOST_SIDES) / 2)
    angle = math.pi / (2 * half)
    outer = radius if rolls else _mean_outer(radius, 2 * half)
    box = Box((2 * outer * math.cos(angle), 2 * outer * math.sin(angle), length))
    return [
        Placed(box, Pose.from_rpy(0.0, 0.0, 0.0, 0.0, 0.0, 2 * angle * number))
        for number in range(half)
    ]


@dataclass(frozen=True, slots=True)
class Wheel:
    """What rolls: `radius` and `width` in m, its axle along the z axis of `pose` in the frame of
    the collision.
    """

    radius: float
    width: float
    pose: Pose = HERE


def tyre(wheel: Wheel) -> list[Placed]:
    """The spheres that stand for a wheel: a ring of them, which has a real tyre's round shoulders,
    or several side by side.

    The mean radius on which it rolls is the wheel's.
    """
    radius = wheel.radius
    half = wheel.width / 2
    shoulder = min(max(half, THINNEST * radius), radius / 2)
    inside = max(0.0, half - shoulder)
    if half <= radius:
        spheres = [
            part
            for place in _spread(inside, shoulder / 2)
            for part in ring(radius, shoulder, place)
        ]
    else:
        # Between two rings that are its shoulders the whole wheel fits as a ball, which it rolls
        # on.
        within = radius * (1 - BUMP_SHARE)
        spheres = [part for place in (-inside, inside) for part in ring(within, shoulder, place)]
        spheres += [
            part
            for place in _spread(half - radius, radius / 4)
            for part in ring(radius, radius, place)
        ]
    return [part._replace(pose=wheel.pose @ part.pose) for part in spheres]


def _spread(inside: float, step: float) -> list[float]:
    """Places from -`inside` to `inside` (m), evenly and at most two `step` (m) apart; the middle if
    that is all.
    """
    count = 1 + math.ceil(inside / step - 1e-9)
    if count == 1:
        return [0.0]
    places: list[float] = np.linspace(-inside, inside, count).tolist()
    return places


def ring(radius: float, width: float, height: float) -> list[Placed]:
    """Spheres of the radius `width` (m) in a ring around z at `height` (m), which reach as far as a
    wheel of `radius` (m).

    A wheel's centre is highest where it stands on one sphere, and lowest between two: it rolls on
    the mean, so they stand out.
    """
    inner = radius - width
    if inner < BUMP_SHARE * radius:
        return [Placed(Sphere(radius), Pose((0.0, 0.0, height)))]
    bump = min(BUMP, BUMP_SHARE * radius)
    even = math.pi / math.acos(max(0.0, 1.0 - bump / inner))
    closed = math.tau * inner / math.sqrt(8 * width * DIP_SHARE * radius)
    count = min(math.ceil(max(even, closed)), MOST_SPHERES)
    inner *= (math.pi / count) / math.sin(math.pi / count)
    angles = (math.tau * number / count for number in range(count))
    places: list[Vector] = [
        (inner * math.cos(angle), inner * math.sin(angle), height) for angle in angles
    ]
    return [Placed(Sphere(width), Pose(place)) for place in places]


# A shape is a wheel if its axis is that of the joint, up to this share of its radius, and it is so
# round.
CENTRED = 0.03
ROUND = 0.95
DIRECTIONS = 24


def wheel_of(collision: Collision, axle: Joint) -> Wheel | None:
    """The wheel that a collision is on the joint `axle`; None if it is none, or rolls on spheres
    anyway.
    """
    # The axle as seen from the collision.
    back = collision.pose.inverse()
    axis = np.array(back.rotate(axle.axis))
    place = np.array((back @ axle.pose).position)
    match collision.shape:
        case Cylinder(radius, length):
            width = length
        case Ellipsoid((radius, other, along)) if math.isclose(radius, other, rel_tol=CENTRED):
            # Half as wide as the circle that fits its cross-section at the ground.
            width = 2 * min(along * along / radius, radius)
        case Mesh(_, vertices):
            return _round_mesh(vertices, place, axis)
        case _:
            return None
    aside = math.hypot(place[0], place[1])
    if abs(axis[2]) < 1 - CENTRED**2 / 2 or aside > CENTRED * radius:
        return None
    return Wheel(radius, width)


def _round_mesh(vertices: Floats, place: Floats, axis: Floats) -> Wheel | None:
    """The wheel that a hull of `vertices` (N, 3) m is about the line through `place` (3,) m along
    the unit vector `axis` (3,).
    """
    turn = pointing(vector(axis))
    points = (vertices - place) @ turn.rotation()
    far = np.hypot(points[:, 0], points[:, 1])
    radius = float(far.max())
    angles = math.tau * np.arange(DIRECTIONS) / DIRECTIONS
    reach = (points[:, :2] @ np.vstack([np.cos(angles), np.sin(angles)])).max(axis=0)
    if reach.min() < ROUND * radius:
        return None
    tread = points[far > ROUND * radius, 2]
    low = float(tread.min())
    high = float(tread.max())
    middle = vector(place + axis * (low + high) / 2)
    return Wheel(radius, high - low, Pose(middle, turn.quaternion))
