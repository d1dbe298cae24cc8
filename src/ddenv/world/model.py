"""A world as plain frozen data: what the simulator, the maps and the writer need of an SDF file.

Every pose is absolute (in the world frame), lengths are in m, masses in kg, angles in rad.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

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
    """Infinite ground with its normal along its frame's z axis; `size` is only how much of it is drawn."""

    size: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Capsule:
    """A cylinder of `length` along its frame's z axis, with half a ball of the same radius on each end."""

    radius: float
    length: float


@dataclass(frozen=True, slots=True)
class Ellipsoid:
    """`radii` along its frame's axes."""

    radii: Vector


@dataclass(frozen=True, slots=True)
class Mesh:
    """A closed surface: `vertices` (N, 3) m, `faces` (M, 3) numbers of vertices, counterclockwise seen from outside.

    Of a collision it is convex. Two meshes are equal if they came from the same file in the same way (`origin`).
    """

    origin: str
    vertices: np.ndarray = field(compare=False, repr=False)
    faces: np.ndarray = field(compare=False, repr=False)


Shape = Box | Cylinder | Sphere | Plane | Capsule | Ellipsoid | Mesh


@dataclass(frozen=True, slots=True)
class Collision:
    """`mu` is the Coulomb friction coefficient of this surface: the smaller of SDF's `ode/mu` and `ode/mu2`."""

    name: str
    shape: Shape
    pose: Pose
    mu: float


@dataclass(frozen=True, slots=True)
class Visual:
    """`color` is red, green, blue, alpha in 0..1, or None where the file names none."""

    name: str
    shape: Shape
    pose: Pose
    color: tuple[float, float, float, float] | None = None


@dataclass(frozen=True, slots=True)
class Inertia:
    """Mass and rotational inertia about the centre of mass, in the axes of `pose` (whose origin is that centre).

    `moments` are ixx, iyy, izz and `products` ixy, ixz, iyz in kg m^2.
    """

    mass: float
    pose: Pose
    moments: Vector
    products: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Link:
    name: str
    pose: Pose
    inertia: Inertia | None
    collisions: tuple[Collision, ...]
    visuals: tuple[Visual, ...]


@dataclass(frozen=True, slots=True)
class Joint:
    """A joint between two links of one model; `pose` is the joint frame, `axis` a unit vector in the world frame.

    `kind` is SDF's type: fixed, revolute, continuous, prismatic, ball or universal (which turns about `axis` and then about
    `axis2`, at right angles to it). Limits are counted from the pose in which the links are: rad, or m for a prismatic one.
    `effort` (N m or N) and `velocity` (rad/s or m/s) are infinite where unlimited. The parent may be "world".
    """

    name: str
    kind: str
    parent: str
    child: str
    pose: Pose
    axis: Vector
    lower: float
    upper: float
    effort: float
    velocity: float
    damping: float
    axis2: Vector | None = None


@dataclass(frozen=True, slots=True)
class Model:
    """A model of the world, with the links and joints of those nested in it (named `inner::link`).

    `name` is unique: a second model of the same name in the file is called `name #2`. `spans` are the parts of the file's text
    that go with it (start and end byte): its own element first, then what `<state>` says of it. `line` is its first line.
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

    @property
    def collisions(self) -> tuple[Collision, ...]:
        return tuple(collision for link in self.links for collision in link.collisions)


@dataclass(frozen=True, slots=True)
class Note:
    """Something that was not taken as the file has it: `kind` tells whether it was replaced or ignored.

    `model` is whose it is (empty: the world's), `place` is file, line and XPath, `what` the element, and `why` the reason, with
    what took its place. `detail` is what differs between models of which the same is said.
    """

    kind: Literal["replaced", "ignored"]
    model: str
    place: str
    what: str
    why: str
    detail: str = ""


@dataclass(frozen=True, slots=True)
class World:
    """An SDF world. `text` is the file as it was read; `models` are in the file's order; `gravity` is in m/s^2.

    `anchors` names models that others are placed relative to: without them the file could not be read any more. `resources`
    holds what was read of other files (`ddenv.world.files.resources`), so that `text` can be read again without them.
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

    def model(self, name: str) -> Model:
        for model in self.models:
            if model.name == name:
                return model
        raise KeyError(name)

    def elements(self, protected: frozenset[str] = frozenset()) -> tuple[str, ...]:
        """Names of the models that a reduction may remove, in the file's order."""
        stay = protected | self.anchors
        return tuple(model.name for model in self.models if model.name not in stay and not is_ground(model))


# A box of this length and width that is shown as an infinite plane is one, m.
ENDLESS = 200.0


def is_ground(model: Model) -> bool:
    """A model with an infinite plane carries everything else: it is never an element.

    So is a box that stands for one: that which `ddenv.world.write` writes.
    """
    if any(isinstance(collision.shape, Plane) for collision in model.collisions):
        return True
    shown = any(isinstance(visual.shape, Plane) for link in model.links for visual in link.visuals)
    boxes = (one.shape.size for one in model.collisions if isinstance(one.shape, Box)) if shown else ()
    return any(min(size[:2]) >= ENDLESS for size in boxes)
