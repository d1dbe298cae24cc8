"""What partitionings and prioritizations may look at."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

# So many models at a time are compared with the whole path: 5,000 at once would take hundreds of MB.
BLOCK = 256


def nearest_on_path(places: np.ndarray, times: np.ndarray, path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far each of `places` (M, 3) is from the path (N, 3), m, and when (s) the robot was at the nearest point: two (M,).

    The path is the segments between its points, which were reached at `times` (N,); of several nearest points the first counts.
    """
    if len(path) == 1:
        path, times = np.repeat(path, 2, axis=0), np.repeat(times, 2)
    distances, moments = np.empty(len(places)), np.empty(len(places))
    for first in range(0, len(places), BLOCK):
        block = slice(first, first + BLOCK)
        apart, fraction = to_segments(places[block], path)
        nearest = apart.argmin(axis=1)
        rows = np.arange(len(nearest))
        distances[block] = apart[rows, nearest]
        moments[block] = times[nearest] + fraction[rows, nearest] * (times[nearest + 1] - times[nearest])
    return distances, moments


def to_segments(places: np.ndarray, path: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The distance (m) of each place (M, 3) to each segment of the path (N, 3), and how far along it that is: two (M, N - 1)."""
    steps = np.diff(path, axis=0)
    lengths = np.einsum("ij,ij->i", steps, steps)
    along = places @ steps.T - np.einsum("ij,ij->i", path[:-1], steps)
    fraction = np.clip(along / np.where(lengths > 0, lengths, 1.0), 0.0, 1.0)
    gaps = [places[:, None, axis] - path[None, :-1, axis] - fraction * steps[None, :, axis] for axis in range(3)]
    return np.sqrt(sum(gap * gap for gap in gaps)), fraction


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
