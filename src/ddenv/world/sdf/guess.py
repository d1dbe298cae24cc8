"""Shapes that `auto` gives to what is missing: a known size, the size that the inertia tells, or one metre."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ddenv.world.pose import ONE, Vector
from ddenv.world.sdf.known_sizes import known_size
from ddenv.world.sdf.standin import StandIn, parse_stand_in
from ddenv.world.sdf.xml import Element, floats

# SDF's default for a moment of inertia, kg m^2: it tells nothing.
DEFAULT_MOMENT = 1.0
SOME = "box:1,1,1"


@dataclass(frozen=True)
class Guess:
    """A stand-in, its `text`, and `why` it is this one; `scale` is that of a mesh of this size.

    It stands where the mesh would, or with `at_mass` at the link's centre of mass.
    """

    stand_in: StandIn
    text: str
    why: str
    scale: Vector
    at_mass: bool = False


def guess(uri: str, link: Element | None = None) -> Guess:
    """The shape for a missing model, or for a missing mesh of the `link`."""
    known = known_size(uri)
    if known is not None:
        return _guess(known.text, "the size of Gazebo's model", known.scale)
    box = None if link is None else _box_of_inertia(link)
    if box is not None:
        return _guess(box, "the box that has the link's inertia", ONE, at_mass=True)
    return _guess(SOME, "nothing says how large it is", ONE)


def _guess(text: str, why: str, scale: Vector, at_mass: bool = False) -> Guess:
    return Guess(parse_stand_in(text, "guess"), text, why, scale, at_mass)


def _box_of_inertia(link: Element) -> str | None:
    """The uniform box with the mass and the moments of `link`; None if there is no such box."""
    inertial = link.find("inertial")
    if inertial is None:
        return None
    mass, x, y, z = (_value(inertial, path) for path in ("mass", "inertia/ixx", "inertia/iyy", "inertia/izz"))
    squares = [6 * (y + z - x), 6 * (x + z - y), 6 * (x + y - z)]
    if not mass > 0 or x == y == z == DEFAULT_MOMENT or not all(1e-6 * mass < square < math.inf for square in squares):
        return None
    sides = ",".join(f"{math.sqrt(square / mass):.3g}" for square in squares)
    return f"box:{sides}@0,0,0"


def _value(inertial: Element, path: str) -> float:
    element = inertial.find(path)
    values = () if element is None else floats(element)
    return values[0] if len(values) == 1 else math.nan
