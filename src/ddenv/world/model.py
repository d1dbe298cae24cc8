"""A world as plain frozen data: what the simulator, the maps and the writer need of an SDF file.

Every pose is absolute (in the world frame), lengths are in m, masses in kg, angles in rad.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

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


Shape = Box | Cylinder | Sphere | Plane


@dataclass(frozen=True, slots=True)
class Collision:
    """`mu` is the Coulomb friction coefficient of this surface (SDF's `ode/mu`)."""

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

    `kind` is SDF's type: fixed, revolute or continuous. `effort` (N m) and `velocity` (rad/s) are infinite where unlimited.
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


@dataclass(frozen=True, slots=True)
class Model:
    """One `<model>`; `span` is where its text stands in the file (start and end byte), `line` its first line."""

    name: str
    pose: Pose
    static: bool
    links: tuple[Link, ...]
    joints: tuple[Joint, ...]
    span: tuple[int, int]
    line: int

    @property
    def collisions(self) -> tuple[Collision, ...]:
        return tuple(collision for link in self.links for collision in link.collisions)


@dataclass(frozen=True, slots=True)
class World:
    """An SDF world. `text` is the file as it was read; `models` are in the file's order; `gravity` is in m/s^2."""

    path: Path
    name: str
    text: bytes
    gravity: Vector
    models: tuple[Model, ...]
    notes: tuple[str, ...] = ()

    def model(self, name: str) -> Model:
        for model in self.models:
            if model.name == name:
                return model
        raise KeyError(name)

    def elements(self, protected: frozenset[str] = frozenset()) -> tuple[str, ...]:
        """Names of the models that a reduction may remove, in the file's order."""
        return tuple(model.name for model in self.models if model.name not in protected and not is_ground(model))


def is_ground(model: Model) -> bool:
    """A model with an infinite plane carries everything else: it is never an element."""
    return any(isinstance(collision.shape, Plane) for collision in model.collisions)
