"""Mass and inertia of moving links: from the file, or computed from their shapes where the file has
none or impossible ones.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from ddenv.world.model import (
    Box,
    Capsule,
    Collision,
    Cylinder,
    Ellipsoid,
    Ground,
    Inertia,
    Mesh,
    Shape,
    Sphere,
)
from ddenv.world.pose import Pose, Vector, vector
from ddenv.world.sdf.context import Context
from ddenv.world.sdf.frames import pose_of
from ddenv.world.sdf.xml import Element, complain, number_or_nan, numbers, text_of

WATER = 1000.0  # kg/m^3, SDF's default density
DEFAULT_MASS = 1.0  # kg, SDF's default for a link without an <inertial>
# Radius of the ball that a link without shapes is taken for, m.
BARE = 0.05
LIGHTEST = 1e-9
HEAVIEST = 1e9  # accepted masses, kg
THINNEST = 1e-3
DENSEST = 1e6  # accepted densities, kg/m^3
LEAST_MOMENT = 1e-15  # minimum principal moment of inertia, kg m^2
# Drake's contacts cannot be solved for a link that turns or moves more easily than this mass,
# spread evenly over its shapes, kg.
LIGHTEST_IN_CONTACT = 1e-5


def read_inertia(
    link: Element,
    link_pose: Pose,
    collisions: Sequence[Collision],
    density: Sequence[float],
    context: Context,
) -> Inertia:
    """The inertia of a moving link at `link_pose`, in the world frame; `density` (kg/m^3) has one
    entry per collision.
    """
    evenly = partial(spread, collisions, density, link_pose)
    inertia = _given(link, link_pose, evenly, context)
    if all(isinstance(one.shape, Ground) for one in collisions):
        return inertia
    least = evenly(LIGHTEST_IN_CONTACT)
    solid_enough = (
        f"contacts need at least those of {LIGHTEST_IN_CONTACT:g} kg, spread evenly over its shapes"
    )
    if inertia.mass < least.mass:
        context.note(
            "replaced", link, f"too light, {inertia.mass:.3g} kg: mass and inertia; {solid_enough}"
        )
        return least
    lowest = _principal(inertia.moments, inertia.products)[0]
    needed = _principal(least.moments, least.products)[0]
    if lowest >= needed:
        return inertia
    context.note(
        "replaced", link, f"too small moments of inertia, {lowest:.3g} kg m^2: {solid_enough}"
    )
    return replace(inertia, moments=vector(moment + needed for moment in inertia.moments))


def _given(
    link: Element,
    link_pose: Pose,
    evenly: Callable[[float | None], Inertia],
    context: Context,
) -> Inertia:
    """The inertia of the file, or where that has none or an impossible one, that of the shapes.

    `evenly` spreads a mass over the shapes.
    """
    element = link.find("inertial")
    if element is None:
        context.note(
            "replaced", link, f"no <inertial>: {DEFAULT_MASS:g} kg, spread evenly over its shapes"
        )
        return evenly(DEFAULT_MASS)
    mass = number_or_nan(element, "mass", DEFAULT_MASS)
    if element.get("auto", "").strip().lower() in ("1", "true"):
        given = element.find("mass") is not None and LIGHTEST <= mass <= HEAVIEST
        return evenly(mass if given else None)
    if not LIGHTEST <= mass <= HEAVIEST:
        computed = evenly(None)
        why = f"{computed.mass:.3g} kg, from its shapes and a density of {WATER:g} kg/m^3"
        context.note("replaced", element, f"mass {mass:g} kg is impossible: {why}")
        return computed
    tensor = element.find("inertia")
    place = element.find("pose")
    pose = Pose() if place is None else pose_of(place)
    if place is not None and (place.get("relative_to") or place.get("frame")):
        context.note("ignored", place, "the centre of mass is read in the frame of its link")
    if tensor is not None:
        moments, products = moments_of(tensor)
        if possible := _possible(moments, products):
            return Inertia(mass, link_pose @ pose, possible, products)
    said = "no <inertia>"
    if tensor is not None:
        words = (text_of(tensor.find(tag))[:12] or "1" for tag in ("ixx", "iyy", "izz"))
        said = f"moments {' '.join(words)} kg m^2 are impossible"
    context.note(
        "replaced", element, f"{said}: computed from its shapes and its mass of {mass:g} kg"
    )
    return evenly(mass)


def moments_of(inertia: Element) -> tuple[Vector, Vector]:
    """The moments ixx, iyy, izz and the products ixy, ixz, iyz in an `<inertia>`, kg m^2.

    NaN for what is no number.
    """
    moments = vector(number_or_nan(inertia, tag, 1.0) for tag in ("ixx", "iyy", "izz"))
    products = vector(number_or_nan(inertia, tag, 0.0) for tag in ("ixy", "ixz", "iyz"))
    return moments, products


def tensor_of(moments: Vector, products: Vector) -> np.ndarray:
    """The matrix (3, 3) of moments and products of inertia."""
    xx, yy, zz = moments
    xy, xz, yz = products
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def read_density(parent: Element, default: float) -> float:
    """The `<density>` in `parent`, kg/m^3. Raises UserError."""
    element = parent.find("density")
    if element is None:
        return default
    density = numbers(element, 1)[0]
    if not THINNEST <= density <= DENSEST:
        raise complain(
            element, f"a density must be from {THINNEST:g} to {DENSEST:g} kg/m^3, found {density:g}"
        )
    return density


def _possible(moments: Vector, products: Vector) -> Vector | None:
    """`moments`, slightly enlarged if only rounding makes them impossible, as for thin plates; None
    if no body can have them.
    """
    low, middle, high = _principal(moments, products)
    excess = high - low - middle
    if -1e-9 * high < excess < 1e-5 * high:
        moments = vector(moment + max(excess, 0.0) + 1e-9 * high for moment in moments)
        low, middle, high = _principal(moments, products)
    if low > LEAST_MOMENT and high <= low + middle:
        return moments
    return None


def _principal(moments: Vector, products: Vector) -> Vector:
    """The principal moments in ascending order; NaN for unusable numbers."""
    tensor = tensor_of(moments, products)
    if not np.isfinite(tensor).all() or np.abs(tensor).max() > HEAVIEST:
        return math.nan, math.nan, math.nan
    low, middle, high = np.linalg.eigvalsh(tensor).tolist()
    return low, middle, high


def spread(
    collisions: Sequence[Collision], density: Sequence[float], link_pose: Pose, mass: float | None
) -> Inertia:
    """The inertia of solid shapes (overlaps count twice), scaled to `mass` (kg) unless that is
    None.
    """
    pairs = [
        (one, each)
        for one, each in zip(collisions, density, strict=True)
        if not isinstance(one.shape, Ground)
    ]
    if not pairs:
        return _ball(link_pose, DEFAULT_MASS if mass is None else mass)
    solids = [(*solid(one.shape), one.pose, each) for one, each in pairs]
    masses = np.array([volume * each for volume, _, _, _, each in solids])
    centers = np.array(
        [np.array(pose.position) + pose.rotation() @ center for _, center, _, pose, _ in solids]
    )
    total = max(float(masses.sum()), LIGHTEST)
    middle = masses @ centers / total
    tensor = np.zeros((3, 3))
    for (_, _, unit, pose, _), each, center in zip(solids, masses, centers, strict=True):
        rotation = pose.rotation()
        arm = center - middle
        tensor += each * (
            rotation @ unit @ rotation.T + (arm @ arm) * np.eye(3) - np.outer(arm, arm)
        )
    factor = 1.0 if mass is None else mass / total
    tensor *= factor
    moments = vector(tensor[axis, axis] for axis in range(3))
    products = (float(tensor[0, 1]), float(tensor[0, 2]), float(tensor[1, 2]))
    possible = _possible(moments, products)
    if possible is None:
        return _ball(link_pose, total * factor)
    return Inertia(total * factor, Pose(vector(middle)), possible, products)


def _ball(link_pose: Pose, mass: float) -> Inertia:
    moment = 0.4 * mass * BARE**2
    return Inertia(mass, link_pose, (moment, moment, moment))


def solid(shape: Shape) -> tuple[float, np.ndarray, np.ndarray]:
    """Volume (m^3), centre (3,) m, and inertia about it for a mass of 1 kg, shape (3, 3) m^2, in
    the shape's own frame.
    """
    origin = np.zeros(3)
    match shape:
        case Box(size):
            x, y, z = (part * part / 12 for part in size)
            return math.prod(size), origin, np.diag([y + z, x + z, x + y])
        case Ellipsoid(radii):
            x, y, z = (part * part / 5 for part in radii)
            return 4 / 3 * math.pi * math.prod(radii), origin, np.diag([y + z, x + z, x + y])
        case Sphere(radius):
            return 4 / 3 * math.pi * radius**3, origin, 0.4 * radius**2 * np.eye(3)
        case Cylinder(radius, length):
            return math.pi * radius**2 * length, origin, _cylinder(radius, length)
        case Capsule(radius, length):
            tube = math.pi * radius**2 * length
            balls = 4 / 3 * math.pi * radius**3
            # Two half balls, each with its centre of mass 3/8 r beyond the end of the tube.
            across = 0.4 * radius**2 + length**2 / 4 + 3 / 8 * length * radius
            unit = tube * _cylinder(radius, length) + balls * np.diag(
                [across, across, 0.4 * radius**2]
            )
            return tube + balls, origin, unit / (tube + balls)
        case Mesh(_, vertices, faces):
            import trimesh

            # About its middle, since the sums lose digits far from the origin.
            middle = vertices.mean(axis=0)
            whole = trimesh.triangles.mass_properties((vertices - middle)[faces])
            return (
                whole.volume,
                whole.center_mass + middle,
                np.asarray(whole.inertia) / whole.volume,
            )
    raise TypeError(type(shape).__name__)


def _cylinder(radius: float, length: float) -> np.ndarray:
    across = radius**2 / 4 + length**2 / 12
    return np.diag([across, across, radius**2 / 2])
