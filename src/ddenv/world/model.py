"""A world as plain frozen data: the part of an SDF file that the simulator, the maps and the writer
need.

Poses are absolute (in the world frame), lengths in m, masses in kg, angles in rad.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from ddenv.text import Names
from ddenv.world.pose import Pose, Vector


@dataclass(frozen=True, slots=True)
class Box:
    size: Vector


@dataclass(frozen=True, slots=True)
class Cylinder:
    """Along its frame's z axis."""

    radius: float
    length: float


@dataclass(frozen=True, slots=True)
class Sphere:
    radius: float


@dataclass(frozen=True, slots=True)
class Plane:
    """Infinite ground with its normal along its frame's z axis; `size` only limits what is
    drawn.
    """

    size: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Capsule:
    """A cylinder of `length` along its frame's z axis, with a hemisphere of the same radius on each
    end.
    """

    radius: float
    length: float


@dataclass(frozen=True, slots=True)
class Ellipsoid:
    """`radii` along its frame's axes."""

    radii: Vector


@dataclass(frozen=True, slots=True)
class Mesh:
    """A closed surface: `vertices` (N, 3) m, `faces` (M, 3) vertex indices, counterclockwise seen
    from outside.

    Convex in a collision. Meshes are equal if they have the same `origin`: the same file, read in
    the same way. A `simplified` mesh is the convex hull of one that is too fine to be drawn.
    """

    origin: str
    vertices: np.ndarray = field(compare=False, repr=False)
    faces: np.ndarray = field(compare=False, repr=False)
    simplified: bool = field(default=False, compare=False)


@dataclass(frozen=True, slots=True)
class Terrain:
    """Solid ground below `heights` (R, C) m, which lie on a grid of `size` (x, y) m around its
    frame's origin.

    Rows follow y, columns x. Between four heights the surface is bilinear.
    Terrains are equal if they have the same `origin`, as meshes are.
    """

    size: tuple[float, float]
    heights: np.ndarray = field(compare=False, repr=False)
    origin: str


# What has no closed surface, but is solid below.
Ground = Plane | Terrain
Shape = Box | Cylinder | Sphere | Capsule | Ellipsoid | Mesh | Ground


@dataclass(frozen=True, slots=True)
class Piece:
    """A convex piece of `mesh`, which is not convex, and its `pose` in the frame of that."""

    mesh: Mesh
    pose: Pose


@dataclass(frozen=True, slots=True, kw_only=True)
class Collision:
    """`mu` is the Coulomb friction coefficient: the smaller of SDF's `ode/mu` and `ode/mu2`.

    The pieces of a mesh that is not convex follow each other in their link, all with the `name` of
    their `<collision>`; `piece` says what they are pieces of.
    """

    name: str
    shape: Shape
    pose: Pose
    mu: float
    piece: Piece | None = field(default=None, compare=False, repr=False)


@dataclass(frozen=True, slots=True)
class Visual:
    """`color` is red, green, blue, alpha in 0..1, or None if the file gives none."""

    name: str
    shape: Shape
    pose: Pose
    color: tuple[float, float, float, float] | None = None


@dataclass(frozen=True, slots=True)
class Inertia:
    """Mass and rotational inertia about the centre of mass, in the axes of `pose`, whose origin is
    that centre.

    `moments` are ixx, iyy, izz and `products` ixy, ixz, iyz in kg m^2.
    """

    mass: float
    pose: Pose
    moments: Vector
    products: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Link:
    name: str
    pose: Pose
    inertia: Inertia | None
    collisions: tuple[Collision, ...]
    visuals: tuple[Visual, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Joint:
    """A joint between two links of one model; `pose` is the joint frame, `axis` a unit vector in
    the world frame.

    `kind` is SDF's type: fixed, revolute, continuous, prismatic, ball or universal (turns about
    `axis`, then about the perpendicular `axis2`). Limits are relative to the initial pose of the
    links: rad, or m for a prismatic joint. `effort` (N m or N) and `velocity` (rad/s or m/s) are
    infinite if unlimited. The parent may be "world".
    """

    name: str
    kind: str
    parent: str
    child: str
    pose: Pose
    axis: Vector = (0.0, 0.0, 1.0)
    lower: float = -math.inf
    upper: float = math.inf
    effort: float = math.inf
    velocity: float = math.inf
    damping: float = 0.0
    axis2: Vector | None = None


# A joint with less play than this (rad or m) counts as fixed.
PLAY = 1e-4


def is_fixed(joint: Joint) -> bool:
    """Whether `joint` allows no motion."""
    limited = joint.kind in ("revolute", "prismatic")
    return joint.kind == "fixed" or (
        limited and joint.upper - joint.lower < PLAY and joint.lower <= 0 <= joint.upper
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Model:
    """A model of the world, including the links and joints of its nested models (named
    `inner::link`).

    `name` is unique: the second model of one name is called `name #2`. `spans` are the byte ranges
    (start, end) of the file that belong to it: its own element first, then its entry in `<state>`.
    `line` is its first line. `inside` is the model of the file that it is a part of
    (`ddenv.world.sdf.inside`); "" for a whole model.
    """

    name: str
    pose: Pose
    static: bool
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    spans: tuple[tuple[int, int], ...]
    line: int
    gravity: bool = True
    self_collide: bool = False
    inside: str = ""

    @property
    def collisions(self) -> tuple[Collision, ...]:
        return tuple(collision for link in self.links for collision in link.collisions)

    @property
    def visuals(self) -> tuple[Visual, ...]:
        return tuple(visual for link in self.links for visual in link.visuals)


def held_with(model: Model, name: str) -> frozenset[str]:
    """The link `name` (or "world") and all that fixed joints hold together with it, directly or
    through others.
    """
    held = {name}
    pairs = [{joint.parent, joint.child} for joint in model.joints if is_fixed(joint)]
    while new := {end for pair in pairs if pair & held for end in pair} - held:
        held |= new
    return frozenset(held)


def still_links(model: Model) -> tuple[Link, ...]:
    """The links of `model` that never move: all if it is static, else those that fixed joints hold
    to the world.
    """
    held = held_with(model, "world")
    return tuple(link for link in model.links if model.static or link.name in held)


def jointed_links(model: Model) -> dict[str, Link]:
    """By Drake's names, such as `arm::forearm`, the links of a model with joints that move; empty
    for any other model.
    """
    if model.static or all(is_fixed(joint) for joint in model.joints):
        return {}
    return {f"{model.name}::{link.name}": link for link in model.links}


# Why a mesh that should be cut into pieces collides as its hull.
UNCUT = "cutting it into pieces crashed or took too long"


@dataclass(frozen=True, slots=True, kw_only=True)
class Note:
    """A part of the file that was replaced or ignored (`kind`).

    `model` is the model it belongs to (empty: the world itself), `place` is file, line and XPath,
    `what` the element, `why` the reason and the replacement. `detail` holds what differs between
    models with otherwise equal notes.
    """

    kind: Literal["replaced", "ignored"]
    model: str
    place: str
    what: str
    why: str
    detail: str = ""


@dataclass(frozen=True, slots=True)
class Found:
    """A file that a URI refers to, in the searched folder `root`, which `source` names, such as an
    environment variable.
    """

    uri: str
    path: Path
    source: str
    root: Path


@dataclass(frozen=True, slots=True)
class Shared:
    """A byte range (start, end) of a world's text that goes when all of `models` are gone, and what
    is written `instead`.
    """

    span: tuple[int, int]
    models: frozenset[str]
    instead: bytes = b""


@dataclass(frozen=True, slots=True, kw_only=True)
class World:
    """An SDF world. `text` is the file's content; `models` are in the file's order; `gravity` is in
    m/s^2.

    `anchors` names the models that others depend on, which always stay: others are placed relative
    to them, or are copies of the same text. `resources` holds everything read from other files
    (`ddenv.world.files.resources`), so that `text` can be read again without them. `ties` has
    (model, other) where a model is welded to another and so cannot stay without it. `shared` has
    byte ranges of `text` that go when several models are gone. `found` are the other files that
    were read from disk, `absent` the URIs without one. `guessed` has (model, URI) where a shape of
    the model is a guess.
    """

    path: Path
    name: str
    text: bytes
    gravity: Vector
    models: tuple[Model, ...]
    version: str = ""
    notes: tuple[Note, ...] = ()
    anchors: frozenset[str] = frozenset()
    resources: Mapping[str, bytes] = field(default_factory=dict, repr=False)
    ties: tuple[tuple[str, str], ...] = ()
    shared: tuple[Shared, ...] = ()
    found: tuple[Found, ...] = field(default=(), repr=False, compare=False)
    absent: tuple[str, ...] = field(default=(), repr=False, compare=False)
    guessed: tuple[tuple[str, str], ...] = ()

    def model(self, name: str) -> Model:
        for model in self.models:
            if model.name == name:
                return model
        raise KeyError(name)

    @property
    def collisions(self) -> tuple[Collision, ...]:
        return tuple(collision for model in self.models for collision in model.collisions)

    @property
    def names(self) -> Names:
        """The names of all models, in the file's order."""
        return tuple(model.name for model in self.models)

    def elements(self, protected: Collection[str] = ()) -> Names:
        """Names of the models that a reduction may remove, in the file's order; a `protected` one
        stays with all its parts.
        """
        parts = {model.name for model in self.models if model.inside in protected}
        stay = new = self.anchors.union(protected, parts)
        while new:
            new = frozenset(other for model, other in self.ties if model in new) - stay
            stay |= new
        stay |= self.ground
        return tuple(name for name in self.names if name not in stay)

    @property
    def ground(self) -> frozenset[str]:
        """The names of the models that carry all others, and so are no elements: ground
        (`is_ground`), except for its tiles.

        Models of terrain are tiles if there are several of them: a trench in one is found like any
        other model.
        """
        grounds = frozenset(model.name for model in self.models if is_ground(model))
        terrain = [
            model.name
            for model in self.models
            if any(isinstance(one.shape, Terrain) for one in model.collisions)
        ]
        if len(terrain) < 2:
            return grounds
        return grounds.difference(terrain)


# A box drawn as an infinite plane, and at least this long and wide, stands for one, m.
ENDLESS = 200.0


def is_ground(model: Model) -> bool:
    """Whether the model holds terrain, an infinite plane, or a box that stands for one (as
    `ddenv.world.write` writes it).
    """
    if any(isinstance(collision.shape, Ground) for collision in model.collisions):
        return True
    shown = any(isinstance(visual.shape, Plane) for visual in model.visuals)
    if not shown:
        return False
    boxes = (one.shape.size for one in model.collisions if isinstance(one.shape, Box))
    return any(min(size[:2]) >= ENDLESS for size in boxes)


def unique_names(names: Sequence[str], sign: str, others: Collection[str] = ()) -> list[str]:
    """`names` with repeated ones made unique, also among `others`: with the `sign` " #" the second
    `name` becomes `name #2`, ...
    """
    given = Counter(others)
    taken = {*names, *others}
    unique = []
    for name in names:
        own = name
        number = given[name]
        while number and own in taken:
            number += 1
            own = f"{name}{sign}{number}"
        given[name] = max(number, 1)
        taken.add(own)
        unique.append(own)
    return unique
