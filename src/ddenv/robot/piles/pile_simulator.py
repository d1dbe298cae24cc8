"""How piles move while nobody comes near them, where they come to rest, and which models rest on
which.

A pile that is simulated together with the robot would change the last bits of the robot's motion,
even from far away: the solver ends its iterations for all contacts of the world at once. So each
pile that starts away from the robot is simulated alone, and played back until the robot, or
something that the robot set in motion, comes near.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import cast

import numpy as np
from pydrake.geometry import QueryObject
from pydrake.math import RotationMatrix
from pydrake.systems.analysis import Simulator

from ddenv.arrays import Booleans
from ddenv.robot.drake.plant import Body
from ddenv.robot.drake.run_context import RunContext
from ddenv.robot.piles.motion import CALM, NEAR, Links, PileMotion, gaps, spread
from ddenv.robot.piles.sleep import Sleep
from ddenv.robot.settled import Settled
from ddenv.text import Names
from ddenv.world.extent import model_bounds
from ddenv.world.model import World, still_links
from ddenv.world.pose import Pose, vector

# The simulated time of all rehearsals of a world whose models never come to rest, and the minimum
# for each of them, s.
BUDGET = 200.0
LEAST = 1.0
MEMORY = 200e6  # what the scripts of a world may take in a worker's memory, bytes


@dataclass(frozen=True, eq=False)
class CachedPile:
    """`script` of the pile `names` is valid while exactly `present` of the static models `near` are
    kept.

    None: the simulation broke.
    """

    names: Names
    near: frozenset[str]
    present: frozenset[str]
    script: PileMotion | None


class PileCache:
    """The scripts of one world's piles. `moving` is the number of models that can move in the whole
    of it.

    They take at most about `MEMORY`: then all go. A script that is rehearsed again is the same to
    the last bit.
    """

    def __init__(self, world: World, moving: int) -> None:
        self.moving = moving
        self._known: dict[Names, list[CachedPile]] = {}
        self._size = 0
        self._static = {
            model.name: model_bounds(model)
            for model in world.models
            if any(link.collisions for link in still_links(model))
        }
        # The static models near each pile of the whole world; None while that is unknown.
        self.usual: dict[Names, frozenset[str]] | None = None

    @property
    def ties(self) -> dict[str, frozenset[str]]:
        """What each model of a pile is tied to: the rest of its pile, and the static models near
        its motion.

        Without these the pile would move otherwise than in the whole world. Empty while `usual` is
        unknown.
        """
        return {
            name: near.union(names) - {name}
            for names, near in (self.usual or {}).items()
            for name in names
        }

    def unusual(
        self, piles: Iterable[CachedPile], present: frozenset[str], held: frozenset[str]
    ) -> frozenset[str]:
        """The models of those among `piles` that do not move as in the whole world, and the static
        ones near them.

        `present` are the models that are kept. A pile with one of `held`, which have no twin,
        counts as well: where such a door was played back while it lay against a falling pile, the
        robot's last bits were not those without the pile. Why is not known.
        """
        usual = self.usual or {}
        other = (
            known
            for known in piles
            if not usual.get(known.names, known.near | {""}) <= present
            or not held.isdisjoint(known.names)
        )
        return frozenset(
            name for known in other for name in (*known.names, *(known.near & present))
        )

    def find(self, names: Names, present: frozenset[str]) -> CachedPile | None:
        """The script of the pile `names` in a world that keeps the models `present`; None if it has
        to be rehearsed.
        """
        for known in self._known.get(names, ()):
            if known.near & present == known.present:
                return known
        return None

    def add(
        self, names: Names, present: frozenset[str], script: PileMotion | None, margin: float
    ) -> CachedPile:
        """Stores the script of a pile that can touch what is within `margin` (m) of its links."""
        near = frozenset(self._static)
        if script is not None:
            low, high = script.bounds()
            low = low - margin
            high = high + margin
            boxes = [(name, box) for name, box in self._static.items() if box]
            near = frozenset(
                name for name, box in boxes if (box[0] < high).all() and (low < box[1]).all()
            )
        known = CachedPile(names, near, near & present, script)
        self._known.setdefault(names, []).append(known)
        # A pile that cannot be rehearsed takes memory, too: the names of all models that stay.
        self._size += 128 * len(near) + (0 if script is None else script.size)
        if self._size > MEMORY:
            self._known = {}
            self._size = 0
        return known


# A contact carries where its normal points at least this far up (the cosine of 60 degrees): boards
# lean on steep edges.
UPWARDS = 0.5
# How often the contacts are looked at within the last `CALM` seconds: models that tremble do not
# touch all the time.
LOOKS = 4


class PileSimulator:
    """Simulates the piles of one plant whose scripts are not in the world's `pile_cache` yet."""

    def __init__(self, pile_cache: PileCache, context: RunContext) -> None:
        self._pile_cache = pile_cache
        self._context = context
        self._plant = context.built.plant
        self._bodies = tuple(context.built.moving.values())
        # The same for every run in this world, whatever is kept: removing a model must not end the
        # script of another.
        self._longest = max(LEAST, BUDGET / max(pile_cache.moving, 1))
        context.hold.reset()
        # The gaps between all moving models (M, M), and from each to the robot (M,), at the start,
        # m.
        self._apart = np.empty((0, 0))
        self._to_robot = np.empty(0)
        if self._bodies:
            links = Links.of(self._bodies)
            robot = Links.of([context.built.robot])
            there = links.observe(self._plant, context.plant_context, range(len(links.bodies)))
            here = robot.observe(self._plant, context.plant_context, range(len(robot.bodies)))
            self._apart = gaps(links, there, links, there)
            self._to_robot = gaps(robot, here, links, there)[0]

    def learn(self, present: frozenset[str]) -> None:
        """Lets the cache know the piles of the whole world, with the models `present`, which
        this plant has.
        """
        if self._pile_cache.usual is None:
            self._context.presence.remove(frozenset())
            self._pile_cache.usual = {
                known.names: known.near for known in self.piles(self._bodies, present)
            }

    def piles(self, kept: Sequence[Body], present: frozenset[str]) -> list[CachedPile]:
        """All piles of `kept` that start away from the robot, in a world that keeps the models
        `present`.

        Call it after `Presence.remove` of all other models.
        """
        names = {body.name for body in kept}
        numbers = [number for number, body in enumerate(self._bodies) if body.name in names]
        joined = self._apart[np.ix_(numbers, numbers)] < NEAR
        near_robot = spread(self._to_robot[numbers] < NEAR, joined)
        return self._known(self._piles(numbers, joined, ~near_robot), present)

    def _settle(self, present: frozenset[str]) -> list[tuple[tuple[Body, ...], PileMotion | None]]:
        """All piles of the plant with their scripts, as if there were no robot. None: the
        simulation broke.

        Piles that come near each other on their way are one pile.
        """
        everything = list(range(len(self._bodies)))
        joined = self._apart < NEAR
        while True:
            piles = self._piles(everything, joined, np.ones(len(everything), dtype=bool))
            settled = [
                (pile, known.script)
                for pile, known in zip(piles, self._known(piles, present), strict=True)
            ]
            meeting = joined | self._meetings(settled)
            if (meeting == joined).all():
                return settled
            joined = meeting

    def settled(self, present: frozenset[str]) -> Settled:
        """How the world settles that has the models `present`."""
        context = self._context
        context.presence.remove(frozenset())
        places: dict[str, tuple[Pose, ...]] = {}
        found: dict[str, set[str]] = {"restless": set(), "fallen": set(), "broken": set()}
        ticks = context.clock.ticks
        seconds = 0.0
        for pile, script in self._settle(present):
            if script is None:
                found["broken"].update(_names(pile))
                continue
            seconds = max(seconds, ticks[len(script.states) - 1].time)
            last = script.motions[-1]
            first = 0
            gone = last.below(context.floor)
            for body, rests in zip(pile, script.resting, strict=True):
                links = range(first, first := first + len(body.links))
                turns = (
                    RotationMatrix(last.turns[link]).ToQuaternion().wxyz().tolist()
                    for link in links
                )
                places[body.name] = tuple(
                    Pose(vector(last.places[link]), (w, x, y, z))
                    for link, (w, x, y, z) in zip(links, turns, strict=True)
                )
                if gone[links].all():
                    found["fallen"].add(body.name)
                elif not rests:
                    found["restless"].add(body.name)
        in_order = [name for name in context.built.moving if name in present]
        return Settled(
            seconds=seconds,
            places={name: places[name] for name in in_order if name in places},
            **{
                kind: tuple(name for name in in_order if name in names)
                for kind, names in found.items()
            },
        )

    def supports(self, present: frozenset[str], elements: frozenset[str]) -> list[tuple[str, str]]:
        """Each of `elements` that can move with each one that it rests on, as (upper, lower),
        sorted.

        `present` are the models of the world. What rests on something that is no element, and so
        always stays, rests on what that rests on.
        """
        hold = self._context.hold
        presence = self._context.presence
        presence.remove(frozenset())
        settled = self._settle(present)
        hold.begin(others=(self._context.built.robot,))
        presence.join(self._bodies, (), robot=False)
        below: dict[str, set[str]] = {}
        try:
            for back in np.linspace(0.0, CALM, LOOKS):
                for pile, script in settled:
                    entries = hold.entries(pile)
                    # A pile whose simulation breaks is taken as it starts.
                    values = hold.start[entries]
                    if script is not None:
                        ticks = self._context.clock.ticks[: len(script.states)]
                        values = script.states[
                            sum(tick.time < ticks[-1].time - back for tick in ticks)
                        ]
                    hold.put(entries, values)
                hold.apply()
                self._note_contacts(below)
        finally:
            presence.part(self._bodies, ())
        pairs = set()
        for upper in elements & set(below):
            reached = set[str]()
            ahead = set(below[upper])
            while ahead:
                one = ahead.pop()
                reached.add(one)
                ahead |= set() if one in elements else below.get(one, set()) - reached
            pairs |= {(upper, lower) for lower in reached & elements - {upper}}
        return sorted(pairs)

    def _note_contacts(self, below: dict[str, set[str]]) -> None:
        """Notes for each model that can move what it rests on now."""
        built = self._context.built
        # The robot's shapes are missing.
        model_of = {shape: name for name, identities in built.shapes() for shape in identities}
        query = cast(
            QueryObject,
            built.plant.get_geometry_query_input_port().Eval(self._context.plant_context),
        )
        for contact in query.ComputePointPairPenetration():
            first = model_of.get(contact.id_A)
            second = model_of.get(contact.id_B)
            # The normal points from the second to the first.
            up = contact.nhat_BA_W[2]
            upper, lower = (first, second) if up > 0 else (second, first)
            if upper and lower and upper != lower and upper in built.moving and abs(up) >= UPWARDS:
                below.setdefault(upper, set()).add(lower)

    def _meetings(self, settled: Sequence[tuple[tuple[Body, ...], PileMotion | None]]) -> Booleans:
        """Which moving models (M, M) of two piles come near each other: by the boxes around all
        that a pile passes through.
        """
        count = len(self._bodies)
        low = np.full((count, 3), np.inf)
        high = np.full((count, 3), -np.inf)
        pile_of = np.full(count, -1)
        number_of = {body.name: number for number, body in enumerate(self._bodies)}
        for pile, (bodies, script) in enumerate(settled):
            members = [number_of[body.name] for body in bodies]
            pile_of[members] = pile
            if script is not None:
                low[members], high[members] = script.bounds()
        apart = np.maximum(low[:, None] - high[None], low[None] - high[:, None]).max(axis=2)
        near: Booleans = (apart < NEAR) & (pile_of[:, None] != pile_of)
        return near

    def _known(
        self, piles: Sequence[tuple[Body, ...]], present: frozenset[str]
    ) -> list[CachedPile]:
        return [
            self._pile_cache.find(_names(pile), present) or self._rehearse(pile, present)
            for pile in piles
        ]

    def _piles(
        self, numbers: Sequence[int], joined: Booleans, left: Booleans
    ) -> list[tuple[Body, ...]]:
        """The moving models `numbers` (K,) in the groups that `joined` (K, K) makes of them; only
        groups that are `left` (K,).
        """
        left = left.copy()
        piles = []
        while left.any():
            one = np.zeros_like(left)
            one[left.argmax()] = True
            pile = spread(one, joined)
            piles.append(
                tuple(
                    self._bodies[number]
                    for number, member in zip(numbers, pile, strict=True)
                    if member
                )
            )
            left &= ~pile
        return piles

    def _rehearse(self, pile: tuple[Body, ...], present: frozenset[str]) -> CachedPile:
        """Simulates the pile alone until all of it rests or its time is up; there is no script if
        the simulation breaks.
        """
        context = self._context
        script = None
        margin = NEAR
        context.diagram_context.SetTime(0.0)
        sleep = Sleep(context, pile, (), alone=True)
        try:
            script = self._rows(pile, sleep)
        # Drake raises SystemExit when one of its own checks fails.
        except (RuntimeError, ValueError, SystemExit):
            pass
        finally:
            sleep.end()
        if script is not None:
            if context.region is not None:
                for motion in script.motions:
                    context.region.check((motion.low, motion.high))
            margin = (
                NEAR + max(motion.speed.max() for motion in script.motions) * context.clock.period
            )
        return self._pile_cache.add(_names(pile), present, script, margin)

    def _rows(self, pile: tuple[Body, ...], sleep: Sleep) -> PileMotion:
        built = self._context.built
        plant_context = self._context.plant_context
        entries = self._context.hold.entries(pile)
        motors = self._plant.get_desired_state_input_port(built.robot.instance)
        motors.FixValue(plant_context, np.zeros(motors.size()))
        simulator = Simulator(built.diagram, self._context.diagram_context)
        states = []
        motions = []
        paces = []
        for tick in self._context.clock.ticks:
            if tick.step:
                simulator.AdvanceTo(tick.time)
            if not np.isfinite(self._context.hold.state()).all():
                raise ValueError("not finite")
            sleep.tick(tick.step)
            states.append(sleep.state()[entries])
            motions.append(sleep.motion.copy())
            paces.append(sleep.pace.copy())
            if sleep.at_rest.all() or tick.time >= self._longest:
                break
        return PileMotion(
            names=_names(pile),
            states=np.array(states),
            motions=tuple(motions),
            paces=tuple(paces),
            resting=sleep.at_rest,
        )


def _names(pile: Iterable[Body]) -> Names:
    return tuple(body.name for body in pile)
