"""The evidence that partitionings and prioritizations can use: positions, the trajectory, what was
sensed, finished tests.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ddenv.arrays import Floats
from ddenv.environment import Environment
from ddenv.text import Names

# Models by name, for schemas.
Place = tuple[float, float, float]

# Probabilities of being needed stay between these, so that no test is impossible.
LEAST = 1e-6
MOST = 1.0 - 1e-6
# The expected number of needed models in each e-fold of the distance's rank.
DENSITY = 0.5
# How many models are compared with the whole path at a time: 5,000 at once would take hundreds of
# MB.
BLOCK = 256


class Lacking(Exception):
    """A schema needs evidence that is not known; the message names the field."""


@dataclass(frozen=True)
class Traits:
    """A model's properties: the longest side of its box (m), its friction coefficient, whether it
    can move.
    """

    size: float = 0.0
    friction: float = 1.0
    dynamic: bool = False


@dataclass(frozen=True)
class Trial:
    """One finished test: the models that were there, and whether it showed f. `elements` are the
    names of all models.
    """

    environment: Environment
    similar: bool
    elements: Names = field(repr=False)

    @property
    def models(self) -> frozenset[str]:
        """The names of the models that were there, collected at each call."""
        return frozenset(self.environment.names(self.elements))


@dataclass(frozen=True, kw_only=True)
class Evidence:
    """What is known about the world, about the last similar run in the current environment, and
    from all tests so far.

    `elements` are in the order of the world file. `positions` maps a model to x, y, z (m).
    `trajectory` (N, 5) is time (s), x, y, z (m), yaw (rad) of that run; `failure_position` where f
    ended, x, y, z (m). `first_sensed` maps a model to the time (s) when that run first sensed it.
    `miss_chance` is the probability that a candidate shows f in none of its tests although all that
    f needs is there. `delta` is in rad/s. A field that is None is unknown; `need` raises for it.
    """

    elements: Names
    positions: Mapping[str, Place] | None = None
    trajectory: Floats | None = None
    failure_position: Place | None = None
    first_sensed: Mapping[str, float] | None = None
    touched: frozenset[str] | None = None
    traits: Mapping[str, Traits] | None = None
    trials: Sequence[Trial] = ()
    miss_chance: float = 0.0
    delta: float = 0.5
    seed: int = 0
    _nearest: dict[str, tuple[float, float]] = field(
        default_factory=dict, repr=False, compare=False
    )

    def need(self, what: str) -> Any:
        """The value of the field `what`. Raises Lacking if it is unknown."""
        value = getattr(self, what)
        if value is None:
            raise Lacking(what)
        return value

    def names(self, models: Iterable[int]) -> Names:
        """The names of models given by their numbers."""
        return tuple(map(self.elements.__getitem__, models))

    def places(self, models: Names) -> Floats:
        """The positions of `models`, shape (len(models), 3), m. Raises Lacking."""
        positions = self.need("positions")
        return np.array([positions[name] for name in models], dtype=float).reshape(-1, 3)

    def centroids(self, partitions: Sequence[Names]) -> Floats:
        """The mean position of each partition, shape (len(partitions), 3), m. Raises Lacking."""
        places = self.places(tuple(name for partition in partitions for name in partition))
        sizes = np.array(list(map(len, partitions)))
        return np.asarray(
            np.add.reduceat(places, np.cumsum(sizes) - sizes, axis=0) / sizes[:, None]
        )

    def nearest(self, models: Names) -> Floats:
        """For each of `models`, how near the robot's path comes to it (m) and when (s): shape
        (len(models), 2). Raises Lacking. Computed once for the whole world.
        """
        if not self._nearest:
            times = self.need("trajectory")[:, 0]
            pairs = zip(
                *nearest_on_path(self.places(self.elements), times, self.path()), strict=True
            )
            self._nearest.update(zip(self.elements, pairs, strict=True))
        return np.array([self._nearest[name] for name in models]).reshape(-1, 2)

    def path(self) -> Floats:
        """The robot's path, shape (N, 3), m. Raises Lacking."""
        return np.asarray(self.need("trajectory")[:, 1:4])


def distances_to_failure(environment: Names, evidence: Evidence) -> Floats:
    """A lower bound of each model's distance from the end of f, shape (len(environment),), m.
    Raises Lacking.
    """
    end = np.array(evidence.need("failure_position"))
    apart = np.linalg.norm(evidence.places(environment) - end, axis=1)
    if not evidence.traits:
        return np.asarray(apart)
    sizes = [evidence.traits[name].size for name in environment]
    return np.asarray(np.maximum(apart - np.array(sizes) / 2, 0.0))


def spatial_prior(environment: Names, evidence: Evidence) -> Floats:
    """The probability that each model is needed, shape (len(environment),): it falls with the rank
    of its distance to f, as 1 / rank, and has no scale. Raises Lacking.
    """
    ranks = np.argsort(
        np.argsort(distances_to_failure(environment, evidence), kind="stable"), kind="stable"
    )
    return np.asarray(np.clip(DENSITY / (1.0 + ranks), LEAST, MOST))


def nearest_on_path(places: Floats, times: Floats, path: Floats) -> tuple[Floats, Floats]:
    """The distance (m) of each of `places` (M, 3) from the path (N, 3), and when (s) the robot was
    at the nearest point: two (M,).

    The path is the segments between its points, reached at `times` (N,). Of several nearest points
    the first counts.
    """
    if len(path) == 1:
        path = np.repeat(path, 2, axis=0)
        times = np.repeat(times, 2)
    distances = np.empty(len(places))
    moments = np.empty(len(places))
    for first in range(0, len(places), BLOCK):
        block = slice(first, first + BLOCK)
        apart, fraction = to_segments(places[block], path)
        nearest = apart.argmin(axis=1)
        rows = np.arange(len(nearest))
        distances[block] = apart[rows, nearest]
        moments[block] = times[nearest] + fraction[rows, nearest] * (
            times[nearest + 1] - times[nearest]
        )
    return distances, moments


def to_segments(places: Floats, path: Floats) -> tuple[Floats, Floats]:
    """The distance (m) of each place (M, 3) to each segment of the path (N, 3), and the fraction
    along it: two (M, N - 1).
    """
    steps = np.diff(path, axis=0)
    lengths = np.einsum("ij,ij->i", steps, steps)
    along = places @ steps.T - np.einsum("ij,ij->i", path[:-1], steps)
    fraction = np.clip(along / np.where(lengths > 0, lengths, 1.0), 0.0, 1.0)
    gaps = [
        places[:, None, axis] - path[None, :-1, axis] - fraction * steps[None, :, axis]
        for axis in range(3)
    ]
    return np.sqrt(sum(gap * gap for gap in gaps)), fraction
