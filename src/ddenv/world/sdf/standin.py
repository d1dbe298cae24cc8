"""Stand-ins: simple shapes that replace missing models and meshes, as the user gives them or as a
guess.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from urllib.parse import unquote

from ddenv.errors import UserError
from ddenv.world.extent import shape_bounds
from ddenv.world.files.resources import model_named
from ddenv.world.model import Box, Capsule, Cylinder, Ellipsoid, Shape, Sphere
from ddenv.world.pose import HERE, ONE, Pose, Vector, vector
from ddenv.world.sdf.xml import Element, number_or_nan

# The sizes (m) of each kind, as shown in error messages.
SIZES = {
    "box": "x,y,z",
    "cylinder": "radius,length",
    "sphere": "radius",
    "capsule": "radius,length",
    "ellipsoid": "x,y,z",
}
SHAPES: dict[str, Callable[..., Shape]] = {
    "box": lambda *size: Box(size),
    "cylinder": Cylinder,
    "sphere": Sphere,
    "capsule": Capsule,
    "ellipsoid": lambda x, y, z: Ellipsoid((x / 2, y / 2, z / 2)),
}
SIBLINGS = ("visual", "collision")
AUTO = "auto"
NONE = "none"
# In place of a URI: everything that is missing.
ALL_MISSING = "*"
LARGEST = 1e6  # m
HOW = (
    f"{', '.join(f'{kind}:{sizes}' for kind, sizes in SIZES.items())} (m), visual, collision, "
    "auto or none"
)


@dataclass(frozen=True)
class Placed:
    """A shape and where it is in the frame of its `<collision>` or `<visual>`, or of what it stands
    in for.

    `pieces` are the convex shapes that collide in place of `shape` if that is a mesh that is not
    convex; none for any other.
    """

    shape: Shape
    offset: Pose = HERE
    pieces: tuple[tuple[Shape, Pose], ...] = ()


# A shape, or a word: `visual` and `collision` are the box around these shapes of the link, `none`
# leaves it out, and `auto` guesses a shape for what is missing, but leaves what is there.
StandIn = Placed | str


def parse_stand_ins(texts: Mapping[str, str]) -> dict[str, StandIn]:
    """The stand-ins of a scenario by the URI that they replace. Raises UserError."""
    found = {uri: parse_stand_in(text, f"stand-in for '{uri}'") for uri, text in texts.items()}
    if ALL_MISSING in found and found[ALL_MISSING] != AUTO:
        raise UserError(
            f"stand-in for '{ALL_MISSING}': only {AUTO} can stand for all that is missing"
        )
    return found


def parse_option(option: str) -> tuple[str, str]:
    """The URI and the shape of `--stand-in URI=SHAPE`. Raises UserError."""
    if option.strip() == AUTO:
        return ALL_MISSING, AUTO
    uri, sign, text = option.rpartition("=")
    if not sign or not uri.strip():
        example = "model://barrel=cylinder:0.3,1.0"
        raise UserError(
            f"--stand-in: expected URI=SHAPE, such as {example}, or auto; found '{option}'"
        )
    uri = uri.strip()
    text = text.strip()
    parse_stand_in(text, "--stand-in")
    parse_stand_ins({uri: text})
    return uri, text


def parse_stand_in(text: str, where: str) -> StandIn:
    """The stand-in written as `kind:sizes` or `kind:sizes@x,y,z`. Raises UserError beginning with
    `where`.

    It stands on the origin of the frame that it replaces, as most meshes of props do; `@x,y,z` sets
    its centre instead.
    """
    if text in (*SIBLINGS, AUTO, NONE):
        return text
    return placed(text, where)


def placed(text: str, where: str) -> Placed:
    """The shape of `kind:sizes` or `kind:sizes@x,y,z`. Raises UserError beginning with `where`."""
    kind, _, rest = text.partition(":")
    words, at, center = rest.partition("@")
    if kind not in SIZES:
        raise UserError(f"{where}: '{text[:60]}' is not a stand-in; use {HOW}")
    sizes = _numbers(words, SIZES[kind], f"{where}: {kind}")
    if min(sizes) <= 0:
        raise UserError(f"{where}: {kind}: sizes must be positive, found '{words[:60]}'")
    shape = SHAPES[kind](*sizes)
    if at:
        place = _numbers(center, "x,y,z", f"{where}: the centre after @")
        return Placed(shape, Pose(vector(place)))
    return Placed(shape, Pose(vector((0.0, 0.0, shape_bounds(shape, HERE)[1][2]))))


def _numbers(text: str, names: str, where: str) -> tuple[float, ...]:
    try:
        values = tuple(float(word) for word in text.split(","))
    except ValueError:
        values = ()
    if len(values) != names.count(",") + 1 or not all(abs(value) <= LARGEST for value in values):
        raise UserError(f"{where}: expected {names} in m, found '{text[:60]}'")
    return values


def matching(stand_ins: Mapping[str, StandIn], uri: str) -> str | None:
    """The longest key of `stand_ins` that is `uri` or a folder above it; None if there is none."""
    found = [key for key in stand_ins if uri == key or uri.startswith(key.rstrip("/") + "/")]
    return max(found, key=len, default=None)


# SDF's default for a moment of inertia, kg m^2: it tells nothing.
DEFAULT_MOMENT = 1.0
SOME = "box:1,1,1"


# A box of any size would be a hill where these words name a floor.
FLOORS = ("floor", "ground", "terrain")
NO_FLOOR = "is left out: a floor of unknown size is not guessed"


def guess(uri: str, link: Element | None = None) -> tuple[Placed, str, str, Vector | None] | None:
    """The shape for a missing model, or for a missing mesh of the `link`: the stand-in, its text,
    and why it is this one.

    It stands where the mesh would, and has the size of a mesh of that scale; without a scale, at
    the link's centre of mass. None for a floor of which nothing says how large it is.
    """
    model = model_named(uri)
    if known := KNOWN_SIZES.get(model):
        scale = MESH_SCALES.get(model, ONE)
        return placed(known, "guess"), known, "the size of Gazebo's model", scale
    if link is not None and (box := _box_of_inertia(link)):
        return placed(box, "guess"), box, "the box that has the link's inertia", None
    if is_floor(uri):
        return None
    return placed(SOME, "guess"), SOME, "nothing says how large it is", ONE


def is_floor(uri: str) -> bool:
    """Whether a model or a mesh is called a floor, such as `FloorB_01`."""
    words = re.findall("[A-Z]?[a-z]+", unquote(uri))
    return any(word.lower() in FLOORS for word in words)


def _box_of_inertia(link: Element) -> str | None:
    """The uniform box with the mass and the moments of `link`; None if there is no such box."""
    inertial = link.find("inertial")
    if inertial is None:
        return None
    mass, x, y, z = (
        number_or_nan(inertial, path)
        for path in ("mass", "inertia/ixx", "inertia/iyy", "inertia/izz")
    )
    squares = [6 * (y + z - x), 6 * (x + z - y), 6 * (x + y - z)]
    if (
        not mass > 0
        or x == y == z == DEFAULT_MOMENT
        or not all(1e-6 * mass < square < math.inf for square in squares)
    ):
        return None
    sides = ",".join(f"{math.sqrt(square / mass):.3g}" for square in squares)
    return f"box:{sides}@0,0,0"


# From the collisions and meshes in github.com/osrf/gazebo_models: the box around the model, or the
# cylinder. Of the barrel without its flat foot, which has a radius of 0.51 m. Only models whose
# mesh has the frame of the model.
KNOWN_SIZES = {
    "asphalt_plane": "box:20,20,0.1@0,0,0",
    "beer": "cylinder:0.055,0.23@0,0,0",
    "bookshelf": "box:0.92,0.405,1.2@0,-0.1925,0.6",
    "brick_box_3x1x3": "box:3,1,3",
    "cabinet": "box:0.47,0.49,1.02@0.01,0,0.51",
    "cafe_table": "box:0.913,0.913,0.775",
    "cardboard_box": "box:0.5,0.4,0.3",
    "cinder_block": "box:0.435,0.203,0.203",
    "cinder_block_2": "box:0.194,0.397,0.143",
    "cinder_block_wide": "box:0.387,0.387,0.143",
    "construction_barrel": "cylinder:0.296,1.315",
    "construction_cone": "cylinder:0.251,1.089",
    "cricket_ball": "sphere:0.0375",
    "drc_practice_2x4": "box:1.219,0.038,0.089@0,0,0",
    "drc_practice_2x6": "box:1.219,0.038,0.14@0,0,0",
    "drc_practice_4x4x20": "box:0.508,0.089,0.089@0,0,0",
    "drc_practice_4x4x40": "box:1.016,0.089,0.089@0,0,0",
    "jersey_barrier": "box:4.065,0.811,1.143",
    "table": "box:1.5,0.8,1.015",
    "wood_cube_10cm": "box:0.1,0.1,0.1",
}
# The scales that draw their meshes in these sizes, if not 1.
MESH_SCALES: dict[str, Vector] = {
    "cardboard_box": (1.259, 1.007, 0.756),
    "construction_cone": (10.0, 10.0, 10.0),
}
