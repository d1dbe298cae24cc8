"""What partitionings and prioritizations may look at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ddenv.reduction.geometry import nearest_on_path

Partition = tuple[str, ...]
Place = tuple[float, float, float]


class Lacking(Exception):
    """A schema looked at something that is not known; the message names it."""


@dataclass(frozen=True)
class Traits:
    """What a model is like: the largest side of the box around it (m), its friction coefficient, whether it can move."""

    size: float = 0.0
    friction: float = 1.0
    dynamic: bool = False


@dataclass(frozen=True)
class Trial:
    """One test that was made: the models that were there, and whether it showed f."""

    models: frozenset[str]
    similar: bool


@dataclass(frozen=True)
class Evidence:
    """What is known of the world, of the last similar run in the current environment, and of all tests so far.

    `elements` are in the order of the world file. `positions` maps a model to x, y, z m. `trajectory` has shape (N, 5): time s,
    x, y, z m, yaw rad of that run. `failure_position` is where f ended, x, y, z m. `first_sensed` maps a model to the time (s)
    when that run first sensed it, `touched` are the models it touched. `miss_chance` is the chance that a candidate does not
    show f in any of its tests although all that f needs is there. `delta` is in rad/s. `seed` makes clustering and random
    orders repeatable. What is None is not known: `need` says so.
    """

    elements: Partition
    positions: Mapping[str, Place] | None = None
    trajectory: np.ndarray | None = None
    failure_position: Place | None = None
    first_sensed: Mapping[str, float] | None = None
    touched: frozenset[str] | None = None
    traits: Mapping[str, Traits] | None = None
    trials: Sequence[Trial] = ()
    miss_chance: float = 0.0
    delta: float = 0.5
    seed: int = 0
    _memory: dict[str, dict[str, tuple[float, float]]] = field(default_factory=dict, repr=False, compare=False)

    def need(self, what: str):
        """The field `what`. Raises Lacking where it is not known."""
        value = getattr(self, what)
        if value is None:
            raise Lacking(what)
        return value

    def places(self, models: Partition) -> np.ndarray:
        """Positions of `models`, shape (len(models), 3), m. Raises Lacking."""
        positions = self.need("positions")
        return np.array([positions[name] for name in models], dtype=float).reshape(-1, 3)

    def centroids(self, partitions: Sequence[Partition]) -> np.ndarray:
        """The mean position of each partition, shape (len(partitions), 3), m. Raises Lacking."""
        places = self.places(tuple(name for partition in partitions for name in partition))
        sizes = np.array([len(partition) for partition in partitions])
        firsts = np.cumsum(sizes) - sizes
        return np.add.reduceat(places, firsts, axis=0) / sizes[:, None]

    def nearest(self, models: Partition) -> np.ndarray:
        """How near the robot came to each of `models` on its path, m, and when, s: shape (len(models), 2). Raises Lacking.

        It is worked out once for the whole world: rounds ask again and again.
        """
        if "nearest" not in self._memory:
            times = self.need("trajectory")[:, 0]
            pairs = zip(*nearest_on_path(self.places(self.elements), times, self.path()), strict=True)
            self._memory["nearest"] = dict(zip(self.elements, pairs, strict=True))
        known = self._memory["nearest"]
        return np.array([known[name] for name in models]).reshape(-1, 2)

    def path(self) -> np.ndarray:
        """Where the robot drove, shape (N, 3), m. Raises Lacking."""
        return self.need("trajectory")[:, 1:4]
