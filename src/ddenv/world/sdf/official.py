"""What the official SDF checker (`ign sdf -k`, libsdformat 12) refuses although we read it: names, and impossible inertia."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from ddenv.world.access import is_directives
from ddenv.world.model import World
from ddenv.world.sdf.context import sdf_root, version
from ddenv.world.sdf.xml import Element, number_or_nan, place

# The checker's slack for rounded numbers, as a part of the greatest moment of inertia that the body can have.
SLACK = 5 * float(np.finfo(float).eps)
# Their names are free, and nothing inside them is looked at. What an include opens is left to the checker.
FREE = ("plugin", "include")
RESERVED_IN = frozenset(["world", "model", "link", "joint", "frame", "collision", "visual", "light", "sensor", "actor"])


def refused(world: World) -> list[tuple[str, str]]:
    """What the official checker would refuse in the file of `world`: the reason, and file, line and XPath; in the file's order."""
    if is_directives(world.path):
        return []
    root = sdf_root(world.text, world.path)
    return [(why, place(at)) for why, at in _inside(root, version(root) >= (1, 8))]


def _inside(element: Element, no_colons: bool) -> Iterator[tuple[str, Element]]:
    children = [child for child in element if child.tag not in FREE]
    names: set[str] = set()
    twice = None
    for child in children:
        name = child.get("name")
        if name is None:
            continue
        twice = child if twice is None and name in names else twice
        names.add(name)
        if no_colons and "::" in name:
            yield "'::' in a name", child
        if child.tag in RESERVED_IN and (name == "world" != child.tag or name[:2] == name[-2:] == "__"):
            yield "a name that is reserved", child
    if twice is not None:
        yield f"a <{element.tag}> with two parts of the same name", twice
    if element.tag == "inertial" and element.find("inertia") is not None and not _is_accepted(element):
        yield "an inertia that no body has", element
    for child in children:
        yield from _inside(child, no_colons)


def _is_accepted(inertial: Element) -> bool:
    """Whether neither the mass nor a moment is negative, and no moment exceeds the sum of the other two."""
    xx, yy, zz = (number_or_nan(inertial, f"inertia/{tag}", 1.0) for tag in ("ixx", "iyy", "izz"))
    xy, xz, yz = (number_or_nan(inertial, f"inertia/{tag}", 0.0) for tag in ("ixy", "ixz", "iyz"))
    tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    largest = np.abs(tensor).max()
    if not (number_or_nan(inertial, "mass", 1.0) >= 0.0 and math.isfinite(largest)):
        return False
    # Numbers near the largest ones would overflow.
    tensor /= largest or 1.0
    # Without products these are the moments themselves, unrounded.
    low, middle, high = np.linalg.eigvalsh(tensor) if any((xy, xz, yz)) else np.sort(np.diag(tensor))
    slack = SLACK * abs(np.trace(tensor))
    return bool(low >= -slack and high <= low + middle + slack)
