"""Stand-ins: simple shapes that replace missing models and meshes."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from ddenv.errors import UserError
from ddenv.world.model import Box, Capsule, Cylinder, Ellipsoid, Shape, Sphere
from ddenv.world.pose import Vector, vector

# The sizes (m) of each kind, as shown in error messages.
SIZES = {
    "box": "x,y,z",
    "cylinder": "radius,length",
    "sphere": "radius",
    "capsule": "radius,length",
    "ellipsoid": "x,y,z",
}
SIBLINGS = ("visual", "collision")
AUTO, NONE = "auto", "none"
# In place of a URI: everything that is missing.
ALL_MISSING = "*"
LARGEST = 1e6  # m
HOW = (
    "box:x,y,z, cylinder:radius,length, sphere:radius, capsule:radius,length, ellipsoid:x,y,z (m), visual, collision, "
    "auto or none"
)


@dataclass(frozen=True)
class StandIn:
    """A `shape` with its `center` in the frame of what it replaces, m; or (None) a `word`.

    `visual` and `collision` are the box around these shapes of the link, `none` leaves it out, and `auto` guesses a shape for
    what is missing, but leaves what is there.
    """

    shape: Shape | None
    center: Vector
    word: str = ""


def parse_stand_ins(texts: Mapping[str, str]) -> dict[str, StandIn]:
    """The stand-ins of a scenario by the URI that they replace. Raises UserError."""
    found = {uri: parse_stand_in(text, f"stand-in for '{uri}'") for uri, text in texts.items()}
    if ALL_MISSING in found and found[ALL_MISSING].word != AUTO:
        raise UserError(f"stand-in for '{ALL_MISSING}': only {AUTO} can stand for all that is missing")
    return found


def parse_option(option: str) -> tuple[str, str]:
    """The URI and the shape of `--stand-in URI=SHAPE`. Raises UserError."""
    if option.strip() == AUTO:
        return ALL_MISSING, AUTO
    uri, sign, text = option.rpartition("=")
    if not sign or not uri.strip():
        raise UserError(
            f"--stand-in: expected URI=SHAPE, such as model://barrel=cylinder:0.3,1.0, or auto; found '{option}'"
        )
    uri, text = uri.strip(), text.strip()
    parse_stand_in(text, "--stand-in")
    parse_stand_ins({uri: text})
    return uri, text


def parse_stand_in(text: str, where: str) -> StandIn:
    """The stand-in written as `kind:sizes` or `kind:sizes@x,y,z`. Raises UserError beginning with `where`.

    It stands on the origin of the frame that it replaces, as most meshes of props do; `@x,y,z` sets its centre instead.
    """
    if text in (*SIBLINGS, AUTO, NONE):
        return StandIn(None, (0.0, 0.0, 0.0), text)
    kind, _, rest = text.partition(":")
    words, at, center = rest.partition("@")
    if kind not in SIZES:
        raise UserError(f"{where}: '{text[:60]}' is not a stand-in; use {HOW}")
    sizes = _numbers(words, SIZES[kind], f"{where}: {kind}")
    if min(sizes) <= 0:
        raise UserError(f"{where}: {kind}: sizes must be positive, found '{words[:60]}'")
    shape = _shape(kind, sizes)
    middle = _numbers(center, "x,y,z", f"{where}: the centre after @") if at else (0.0, 0.0, _height(shape) / 2)
    return StandIn(shape, vector(middle))


def _numbers(text: str, names: str, where: str) -> tuple[float, ...]:
    try:
        values = tuple(float(word) for word in text.split(","))
    except ValueError:
        values = ()
    if len(values) != names.count(",") + 1 or not all(map(math.isfinite, values)) or max(map(abs, values)) > LARGEST:
        raise UserError(f"{where}: expected {names} in m, found '{text[:60]}'")
    return values


def _shape(kind: str, sizes: tuple[float, ...]) -> Shape:
    match kind:
        case "box":
            return Box(vector(sizes))
        case "cylinder":
            return Cylinder(*sizes)
        case "sphere":
            return Sphere(*sizes)
        case "capsule":
            return Capsule(*sizes)
    return Ellipsoid(vector(size / 2 for size in sizes))


def _height(shape: Shape) -> float:
    match shape:
        case Box(size):
            return size[2]
        case Cylinder(_, length):
            return length
        case Sphere(radius):
            return 2 * radius
        case Capsule(radius, length):
            return length + 2 * radius
        case Ellipsoid(radii):
            return 2 * radii[2]
    raise TypeError(type(shape).__name__)


def matching(stand_ins: Mapping[str, StandIn], uri: str) -> str | None:
    """The longest key of `stand_ins` that is `uri` or a folder above it; None if there is none."""
    found = [key for key in stand_ins if uri == key or uri.startswith(key.rstrip("/") + "/")]
    return max(found, key=len, default=None)
