"""The links of what moves: the boxes around them, how fast they are, and how far they are apart."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from pydrake.multibody.plant import MultibodyPlant
from pydrake.multibody.tree import RigidBody
from pydrake.systems.framework import Context

from ddenv.robot.drake.plant import Body, Built

# Half the size of a box around nothing: no other box is ever near it, m.
NOTHING = -1e6


@dataclass(frozen=True)
class Motion:
    """Of some links: the boxes around them along the world's axes, `low` and `high` (N, 3) m, and `speed` (N,) m/s.

    `places` (N, 3) m and `turns` (N, 3, 3) are the poses of the links. No point of a link is faster than its speed.
    """

    low: np.ndarray
    high: np.ndarray
    speed: np.ndarray
    places: np.ndarray
    turns: np.ndarray

    @classmethod
    def still(cls, count: int) -> Motion:
        """Of `count` links in the world's origin."""
        zeros = np.zeros((count, 3))
        return cls(zeros, zeros.copy(), np.zeros(count), zeros.copy(), np.zeros((count, 3, 3)))

    def of(self, numbers: Sequence[int]) -> Motion:
        """That of the links `numbers`."""
        return Motion(*(part[numbers] for part in self._parts()))

    def put(self, numbers: Sequence[int], other: Motion) -> None:
        """Makes `other` the motion of the links `numbers`."""
        for mine, others in zip(self._parts(), other._parts(), strict=True):
            mine[numbers] = others

    def below(self, height: float) -> np.ndarray:
        """Which links (N,) are all below `height` (m). Around nothing the highest corner is below the lowest."""
        empty = self.high[:, 2] < self.low[:, 2]
        return np.where(empty, self.places[:, 2], self.high[:, 2]) < height

    def _parts(self) -> tuple[np.ndarray, ...]:
        return self.low, self.high, self.speed, self.places, self.turns


@dataclass(frozen=True)
class Links:
    """All links of some models, one model after the other. `first` is the number of each model's first link.

    `centers` and `halves` (N, 3) m are the boxes around the links along their own axes, `reach` (N,) m how far their corners are
    from the links' origins.
    """

    bodies: tuple[RigidBody, ...]
    first: np.ndarray
    centers: np.ndarray
    halves: np.ndarray
    reach: np.ndarray

    @classmethod
    def of(cls, models: Sequence[Body]) -> Links:
        bounds = [bounds for model in models for bounds in model.bounds]
        centers = np.array([(one[0] + one[1]) / 2 if one else np.zeros(3) for one in bounds]).reshape(-1, 3)
        halves = np.array([(one[1] - one[0]) / 2 if one else np.full(3, NOTHING) for one in bounds]).reshape(-1, 3)
        return cls(
            bodies=tuple(link for model in models for link in model.links),
            first=np.cumsum([0, *(len(model.links) for model in models)], dtype=int)[:-1],
            centers=centers,
            halves=halves,
            reach=np.linalg.norm(np.abs(centers) + np.maximum(halves, 0.0), axis=1),
        )

    def observe(self, plant: MultibodyPlant, context: Context, numbers: Sequence[int]) -> Motion:
        """How the links `numbers` are and move in `context`."""
        poses = [plant.EvalBodyPoseInWorld(context, self.bodies[number]) for number in numbers]
        turns = np.array([pose.rotation().matrix() for pose in poses]).reshape(-1, 3, 3)
        places = np.array([pose.translation() for pose in poses]).reshape(-1, 3)
        rates = [plant.EvalBodySpatialVelocityInWorld(context, self.bodies[number]) for number in numbers]
        turning = np.linalg.norm(np.array([rate.rotational() for rate in rates]).reshape(-1, 3), axis=1)
        moving = np.linalg.norm(np.array([rate.translational() for rate in rates]).reshape(-1, 3), axis=1)
        centers = np.einsum("nij,nj->ni", turns, self.centers[numbers]) + places
        halves = np.einsum("nij,nj->ni", np.abs(turns), self.halves[numbers])
        return Motion(centers - halves, centers + halves, moving + turning * self.reach[numbers], places, turns)

    def pace(self, numbers: Sequence[int], before: Motion, after: Motion, seconds: float) -> np.ndarray:
        """How fast (N,) the links `numbers` got from one pose to another in so many seconds, m/s; of each its fastest point.

        Unlike `Motion.speed` this is small for what trembles, as boards do that lie across each other.
        """
        way = np.linalg.norm(after.places - before.places, axis=1)
        turn = np.linalg.norm(after.turns - before.turns, axis=(1, 2)) / np.sqrt(2.0)
        return (way + turn * self.reach[numbers]) / seconds

    def of_models(self, numbers: Sequence[int]) -> list[int]:
        """The numbers of all links of the models `numbers`."""
        ends = [*self.first[1:], len(self.bodies)]
        return [link for number in numbers for link in range(self.first[number], ends[number])]


def gaps(a: Links, of_a: Motion, b: Links, of_b: Motion) -> np.ndarray:
    """How far each model of `a` is from each of `b`, along the axis where it is most; below 0 where boxes overlap, m."""
    apart = np.maximum(of_a.low[:, None] - of_b.high[None], of_b.low[None] - of_a.high[:, None]).max(axis=2)
    return np.minimum.reduceat(np.minimum.reduceat(apart, a.first, axis=0), b.first, axis=1)


def spread(start: np.ndarray, joined: np.ndarray) -> np.ndarray:
    """All that hang together with any of `start` (N,) by way of `joined` (N, N), both of bool."""
    reached = start
    while True:
        wider = reached | joined[:, reached].any(axis=1)
        if (wider == reached).all():
            return reached
        reached = wider


# Held joints are kept this far inside their limits (rad or m): a joint at its limit is work for the solver.
INSIDE = 1e-6


class Hold:
    """The models of one context that are held: put where they belong, without speed, and without weight.

    With their collisions filtered they are then no part of the solver's problem, and change no bit of the others' motion.
    (`Joint.Lock` would do the same, but crashes Drake where static geometry is on the world body, drake#24773.)
    """

    def __init__(self, built: Built, plant_context: Context, start: np.ndarray) -> None:
        """`start` are the positions and velocities in which a run starts."""
        self._plant = built.plant
        self._context = plant_context
        self.start = start
        self._bodies = tuple(built.moving.values())
        self._count = built.plant.num_positions()
        self._held = np.zeros(len(start), dtype=bool)
        self._changed = True
        self._state = start.copy()
        low, high = built.plant.GetPositionLowerLimits(), built.plant.GetPositionUpperLimits()
        inside = np.minimum(INSIDE, (high - low) / 4)
        self._low, self._high = low + inside, high - inside

    def entries(self, bodies: Iterable[Body]) -> np.ndarray:
        """Where the positions and velocities of `bodies` stand in the plant's state."""
        plant, found = self._plant, []
        for body in bodies:
            found.append(plant.GetPositionsFromArray(body.instance, np.arange(self._count, dtype=float)))
            velocities = np.arange(self._count, len(self.start), dtype=float)
            found.append(plant.GetVelocitiesFromArray(body.instance, velocities))
        return np.concatenate([np.empty(0), *found]).astype(int)

    def begin(self, others: Sequence[Body] = ()) -> None:
        """Puts everything where it starts, and holds all moving models and `others`."""
        self._held[:] = False
        self._state[:] = self.start
        self._plant.SetPositionsAndVelocities(self._context, self.start)
        entries = self.entries([*self._bodies, *others])
        self.put(entries, self.start[entries])
        self.apply()

    def put(self, entries: np.ndarray, values: np.ndarray) -> None:
        """Holds `entries` of the state, at the positions that are in `values`, from the next `apply` on."""
        self._held[entries] = self._changed = True
        self._state[entries] = values
        self._state[: self._count] = np.clip(self._state[: self._count], self._low, self._high)
        self._state[self._count :] = 0.0

    def release(self, entries: np.ndarray, values: np.ndarray) -> None:
        """Lets `entries` of the state move, from `values` on."""
        self._held[entries] = False
        self._changed = True
        state = self.state()
        state[entries] = values
        self._plant.SetPositionsAndVelocities(self._context, state)

    def state(self) -> np.ndarray:
        """All positions and velocities."""
        return self._plant.GetPositionsAndVelocities(self._context)

    def apply(self) -> None:
        """Puts what is held in its place, and takes its weight.

        To be repeated at each tick: free models stay where they are to the last bit, but what stands upright on a joint is like a
        pencil on its tip, and rounding alone would topple it within seconds.
        """
        if not (self._bodies or self._changed):
            return
        state, held = self.state(), self._held
        if not np.array_equal(state[held], self._state[held]):
            state[held] = self._state[held]
            self._plant.SetPositionsAndVelocities(self._context, state)
        if self._changed:
            force = -self._plant.CalcGravityGeneralizedForces(self._context)
            force[~self._held[self._count :]] = 0.0
            self._plant.get_applied_generalized_force_input_port().FixValue(self._context, force)
            self._changed = False
