"""The motion of models: boxes around their links, speeds and gaps; when one lies still; how a pile
moves by itself.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context

from ddenv.arrays import Booleans, Floats, Integers
from ddenv.robot.drake.plant import Body
from ddenv.text import Names
from ddenv.world.extent import Bounds

NEAR = 0.1  # m; models this near to something that moves are simulated with it
NOTHING = -1e6  # half the size of a box around nothing: no other box is ever near it, m


@dataclass(frozen=True, kw_only=True)
class Motion:
    """Where N links are and how fast they move.

    `low` and `high` (N, 3) are the corners of the boxes around the links along the world's axes, m.
    No point of a link is faster than its `speed` (N,), m/s. `places` (N, 3) m and `turns` (N, 3, 3)
    are the links' poses in the world frame.
    """

    low: Floats
    high: Floats
    speed: Floats
    places: Floats
    turns: Floats

    @classmethod
    def still(cls, count: int) -> Motion:
        """`count` links at rest at the world's origin."""
        zeros = np.zeros((count, 3))
        return cls(
            low=zeros,
            high=zeros.copy(),
            speed=np.zeros(count),
            places=zeros.copy(),
            turns=np.zeros((count, 3, 3)),
        )

    def of(self, numbers: Sequence[int]) -> Motion:
        """The motion of the links `numbers` alone."""
        return Motion(**{name: part[numbers] for name, part in vars(self).items()})

    def copy(self) -> Motion:
        return Motion(**{name: part.copy() for name, part in vars(self).items()})

    def put(self, numbers: Sequence[int], other: Motion) -> None:
        """Overwrites the motion of the links `numbers` with `other`."""
        for mine, others in zip(vars(self).values(), vars(other).values(), strict=True):
            mine[numbers] = others

    def below(self, height: float) -> Booleans:
        """Which links (N,) lie completely below `height` (m)."""
        # A box around nothing has its highest corner below its lowest.
        empty = self.high[:, 2] < self.low[:, 2]
        return np.where(empty, self.places[:, 2], self.high[:, 2]) < height


@dataclass(frozen=True, kw_only=True)
class Links:
    """All N links of M models, one model after the other; model m begins at link `first[m]`.

    `centers` and `halves` (N, 3) m are the boxes around the links along their own axes, `reach`
    (N,) m the distance of their farthest corners from the links' origins.
    """

    bodies: tuple[RigidBody, ...]
    first: Integers
    centers: Floats
    halves: Floats
    reach: Floats

    @classmethod
    def of(cls, models: Sequence[Body]) -> Links:
        bounds = [bounds for model in models for bounds in model.bounds]
        centers = np.array(
            [(one[0] + one[1]) / 2 if one else np.zeros(3) for one in bounds]
        ).reshape(-1, 3)
        halves = np.array(
            [(one[1] - one[0]) / 2 if one else np.full(3, NOTHING) for one in bounds]
        ).reshape(-1, 3)
        return cls(
            bodies=tuple(link for model in models for link in model.links),
            first=np.cumsum([0, *(len(model.links) for model in models)], dtype=int)[:-1],
            centers=centers,
            halves=halves,
            reach=np.linalg.norm(np.abs(centers) + np.maximum(halves, 0.0), axis=1),
        )

    def observe(self, plant: MultibodyPlant, context: Context, numbers: Sequence[int]) -> Motion:
        """The motion of the links `numbers` in `context`, a context of `plant`."""
        poses = [plant.EvalBodyPoseInWorld(context, self.bodies[number]) for number in numbers]
        turns = np.array([pose.rotation().matrix() for pose in poses]).reshape(-1, 3, 3)
        places = np.array([pose.translation() for pose in poses]).reshape(-1, 3)
        rates = [
            plant.EvalBodySpatialVelocityInWorld(context, self.bodies[number]) for number in numbers
        ]
        turning = np.linalg.norm(
            np.array([rate.rotational() for rate in rates]).reshape(-1, 3), axis=1
        )
        moving = np.linalg.norm(
            np.array([rate.translational() for rate in rates]).reshape(-1, 3), axis=1
        )
        centers = np.einsum("nij,nj->ni", turns, self.centers[numbers]) + places
        halves = np.einsum("nij,nj->ni", np.abs(turns), self.halves[numbers])
        return Motion(
            low=centers - halves,
            high=centers + halves,
            speed=moving + turning * self.reach[numbers],
            places=places,
            turns=turns,
        )

    def ways(self, numbers: Sequence[int] | slice, before: Motion, after: Motion) -> Floats:
        """How far (K,) each link's farthest point has moved between two motions, m.

        Over time that is small, unlike `Motion.speed`, for links that only tremble, as boards do
        that lie across each other.
        """
        way = np.linalg.norm(after.places - before.places, axis=1)
        turn = np.linalg.norm(after.turns - before.turns, axis=(1, 2)) / np.sqrt(2.0)
        return cast(Floats, way + turn * self.reach[numbers])

    @property
    def models(self) -> Integers:
        """The model (N,) of each link."""
        return np.repeat(np.arange(len(self.first)), np.diff([*self.first, len(self.bodies)]))

    def of_models(self, numbers: Sequence[int] | Integers) -> list[int]:
        """The numbers of all links of the models `numbers`."""
        ends = [*self.first[1:], len(self.bodies)]
        return [link for number in numbers for link in range(self.first[number], ends[number])]


def gaps(a: Links, of_a: Motion, b: Links, of_b: Motion) -> Floats:
    """The gaps (A, B) between the models of `a` and those of `b`, m: along the axis where the gap
    is widest.

    Below 0 where boxes overlap.
    """
    apart = np.maximum(
        of_a.low[:, None] - of_b.high[None], of_b.low[None] - of_a.high[:, None]
    ).max(axis=2)
    rows: Floats = np.minimum.reduceat(apart, a.first, axis=0)
    return np.minimum.reduceat(rows, b.first, axis=1)


def tight_gaps(a: Links, of_a: Motion, b: Links, of_b: Motion, wanted: Booleans) -> Floats:
    """As `gaps`, but between boxes along the links' own axes, which lie closer around long models
    that lie askew.

    `wanted` (A, B) are the pairs of models that matter: the gaps of all others are infinite.
    """
    apart = np.full((len(a.bodies), len(b.bodies)), np.inf)
    rows, columns = np.nonzero(wanted[a.models][:, b.models])
    if len(rows):
        turns = of_a.turns[rows]
        others_turns = of_b.turns[columns]
        way = np.einsum("nij,nj->ni", others_turns, b.centers[columns]) + of_b.places[columns]
        way = way - np.einsum("nij,nj->ni", turns, a.centers[rows]) - of_a.places[rows]
        # The 15 axes that can part two boxes.
        own = np.swapaxes(turns, 1, 2)
        others = np.swapaxes(others_turns, 1, 2)
        crosses = np.cross(own[:, :, None], others[:, None]).reshape(len(way), 9, 3)
        lengths = np.linalg.norm(crosses, axis=2, keepdims=True)
        crosses = np.where(lengths > 1e-6, crosses / np.maximum(lengths, 1e-6), 0.0)
        axes = np.concatenate([own, others, crosses], axis=1)
        spans = [
            np.einsum("nkj,nj->nk", np.abs(np.einsum("nka,nja->nkj", axes, each)), halves)
            for each, halves in ((own, a.halves[rows]), (others, b.halves[columns]))
        ]
        apart[rows, columns] = (
            np.abs(np.einsum("nka,na->nk", axes, way)) - spans[0] - spans[1]
        ).max(axis=1)
    least: Floats = np.minimum.reduceat(apart, a.first, axis=0)
    return np.minimum.reduceat(least, b.first, axis=1)


def spread(start: Booleans, joined: Booleans) -> Booleans:
    """`start` (N,) and all that is connected with it, directly or through others, where `joined`
    (N, N) is True.
    """
    reached = start
    while True:
        wider = reached | joined[:, reached].any(axis=1)
        if (wider == reached).all():
            return reached
        reached = wider


SLOW = 0.03  # m/s
CALM = 0.3  # s; a model that was slow for this long is at rest


class Stillness:
    """For how long each of M models has stayed where it is, up to the way that something slow makes
    in that time.
    """

    def __init__(self, links: Links) -> None:
        self._links = links
        self._was = Motion.still(len(links.bodies))
        self._calm = np.zeros(len(links.first))  # s

    def look(self, motion: Motion, seconds: float) -> None:
        """Takes in where all links are, `seconds` after the last time."""
        self._calm += seconds
        self.restart(self.moved(motion), motion)

    def moved(self, motion: Motion) -> Booleans:
        """Which models (M,) have moved since their time was last counted anew."""
        ways = self._links.ways(slice(None), self._was, motion)
        return np.maximum.reduceat(ways, self._links.first) > SLOW * CALM

    def restart(self, models: Booleans, motion: Motion) -> None:
        """Counts the time of `models` (M,) from now on."""
        links = self._links.of_models(np.flatnonzero(models))
        self._was.put(links, motion.of(links))
        self._calm[models] = 0.0

    @property
    def at_rest(self) -> Booleans:
        """Which models (M,) have been still for long enough."""
        return self._calm >= CALM


@dataclass(frozen=True, kw_only=True)
class PileMotion:
    """How a pile of K models moves alone, with a row for each tick of the clock.

    `names` are its models in the order of the plant. `states` (T, E) are the pile's positions and
    velocities in the order of `Hold.entries`; `motions` and `paces` (T of each) are those of its
    links, paces their mean speeds since the row before, m/s. `resting` (K,) are the models that are
    at rest after the last row, or have fallen out of the world.
    """

    names: Names
    states: Floats
    motions: tuple[Motion, ...]
    paces: tuple[Floats, ...]
    resting: Booleans

    def bounds(self) -> Bounds:
        """The lowest and the highest corner of the box around all that the pile passes through,
        m.
        """
        low = np.min([motion.low.min(axis=0) for motion in self.motions], axis=0)
        return low, np.max([motion.high.max(axis=0) for motion in self.motions], axis=0)

    @property
    def size(self) -> int:
        """About how much memory it takes, bytes."""
        arrays = [
            self.states,
            *self.paces,
            *(part for motion in self.motions for part in vars(motion).values()),
        ]
        return sum(array.nbytes + 128 for array in arrays)
