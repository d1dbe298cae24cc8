"""What a link is made of: shapes, friction, colour and inertia of one SDF element."""

from __future__ import annotations

from pathlib import Path

from ddenv.world.model import Box, Cylinder, Inertia, Plane, Shape, Sphere
from ddenv.world.pose import Pose
from ddenv.world.sdf.xml import Element, complain, number, numbers

SHAPES = ("box", "cylinder", "sphere", "plane")
# SDF's default for <mu>, and what simulators use where a surface names none.
DEFAULT_MU = 1.0


def read_shape(parent: Element, path: Path) -> Shape:
    """The shape of a `<collision>` or `<visual>`; sizes must be above zero."""
    geometry = parent.find("geometry")
    if geometry is None or not len(geometry):
        raise complain(parent, path, "has no <geometry>")
    element = geometry[0]
    if element.tag not in SHAPES:
        raise complain(element, path, f"<{element.tag}> is not supported yet; use one of {', '.join(SHAPES)}")
    if element.tag == "box":
        return Box(_sizes(element, "size", path, 3))
    if element.tag == "cylinder":
        return Cylinder(_sizes(element, "radius", path, 1)[0], _sizes(element, "length", path, 1)[0])
    if element.tag == "sphere":
        return Sphere(_sizes(element, "radius", path, 1)[0])
    return _plane(element, path)


def _plane(element: Element, path: Path) -> Plane:
    normal = element.find("normal")
    if normal is not None and numbers(normal, path, 3)[:2] != (0.0, 0.0):
        raise complain(normal, path, "only planes with a vertical normal are supported; turn the model with its <pose>")
    size = (100.0, 100.0) if element.find("size") is None else _sizes(element, "size", path, 2)
    return Plane(size)


def _sizes(parent: Element, tag: str, path: Path, count: int) -> tuple[float, ...]:
    element = parent.find(tag)
    if element is None:
        raise complain(parent, path, f"has no <{tag}>")
    values = numbers(element, path, count)
    if min(values) <= 0:
        raise complain(element, path, f"sizes must be above zero, found '{(element.text or '').strip()}'")
    return values


def read_friction(collision: Element, path: Path) -> float:
    """The Coulomb coefficient: SDF's `surface/friction/ode/mu`."""
    ode = collision.find("surface/friction/ode")
    mu = DEFAULT_MU if ode is None else number(ode, "mu", path, DEFAULT_MU)
    if mu < 0:
        raise complain(ode.find("mu"), path, f"friction must not be negative, found {mu:g}")
    return mu


def read_color(visual: Element, path: Path) -> tuple[float, float, float, float] | None:
    """The diffuse colour, or else the ambient one."""
    for tag in ("material/diffuse", "material/ambient"):
        element = visual.find(tag)
        if element is not None:
            count = 4 if len((element.text or "").split()) == 4 else 3
            values = tuple(min(max(value, 0.0), 1.0) for value in numbers(element, path, count))
            return (*values, 1.0)[:4]
    return None


def read_inertia(link: Element, link_pose: Pose, path: Path) -> Inertia | None:
    """The `<inertial>` of a link in the world frame, or None where there is none."""
    element = link.find("inertial")
    if element is None:
        return None
    mass = number(element, "mass", path, 1.0)
    if mass <= 0:
        raise complain(element, path, f"<mass> must be above zero, found {mass:g}")
    tensor = element.find("inertia")

    def part(tag: str, default: float) -> float:
        return default if tensor is None else number(tensor, tag, path, default)

    place = element.find("pose")
    pose = Pose() if place is None else Pose.from_rpy(*numbers(place, path, 6))
    moments = (part("ixx", 1.0), part("iyy", 1.0), part("izz", 1.0))
    products = (part("ixy", 0.0), part("ixz", 0.0), part("iyz", 0.0))
    return Inertia(mass, link_pose @ pose, moments, products)
