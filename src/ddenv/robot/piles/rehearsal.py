"""How models move while nobody comes near them: worked out once for each pile, and played back in every run.

A pile that is simulated together with the robot would change the last bits of the robot's motion, also from far away: the
solver ends its iterations for all contacts of the world at once. So each pile that starts away from the robot is simulated
alone, and is played back until the robot, or something that it set in motion, comes near.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from pydrake.systems.analysis import Simulator
from pydrake.systems.framework import Context

from ddenv.robot.clock import Clock
from ddenv.robot.drake.articulation import anchored
from ddenv.robot.drake.plant import Body, Built
from ddenv.robot.drake.presence import Presence
from ddenv.robot.piles.moving_models import Hold, Links, Motion, gaps, spread
from ddenv.world.extent import model_bounds
from ddenv.world.model import Model, World


@dataclass(frozen=True)
class Script:
    """How a pile moves alone: its models by `names` in the file's order, and a row for each instant at which something is due.

    `states` are the pile's positions and velocities in the order of `Hold.entries`, `motions` and `paces` (`Links.pace`, m/s)
    those of its links. With `rests` all of it is at rest after the last row, or has fallen out of the world; otherwise it still
    moves.
    """

    names: tuple[str, ...]
    states: np.ndarray
    motions: tuple[Motion, ...]
    paces: tuple[np.ndarray, ...]
    rests: bool


@dataclass(frozen=True)
class Known:
    """`script` holds where of the static models `near` just `present` are kept. None: the simulation broke."""

    near: frozenset[str]
    present: frozenset[str]
    script: Script | None


class Repertoire:
    """What is known of the piles of one world. `moving` is the number of its models that move."""

    def __init__(self, world: World) -> None:
        self.moving = sum(1 for model in world.models if not model.static and model.links)
        self._known: dict[tuple[str, ...], list[Known]] = {}
        self._static = {model.name: model_bounds(model) for model in world.models if _has_static(model)}

    def find(self, names: tuple[str, ...], present: frozenset[str]) -> Known | None:
        """What is known of the pile of the models `names` where the models `present` are kept; None if it is unknown."""
        candidates = self._known.get(names, ())
        return next((known for known in candidates if known.near & present == known.present), None)

    def add(self, names: tuple[str, ...], present: frozenset[str], script: Script | None, margin: float) -> None:
        """Keeps the script of a pile, which can meet what is `margin` (m) away from it."""
        near = frozenset(self._static) if script is None else frozenset(self._near(script.motions, margin))
        self._known.setdefault(names, []).append(Known(near, near & present, script))

    def _near(self, motions: Iterable[Motion], margin: float) -> Iterable[str]:
        """The static models that a pile could have met on its way."""
        low = np.min([motion.low.min(axis=0) for motion in motions], axis=0) - margin
        high = np.max([motion.high.max(axis=0) for motion in motions], axis=0) + margin
        return (name for name, box in self._static.items() if box and (box[0] < high).all() and (low < box[1]).all())


def _has_static(model: Model) -> bool:
    """Whether something of `model` never moves and can be touched."""
    held = anchored(model)
    links = (link for link in model.links if model.static or link.name in held)
    return any(link.collisions for link in links)


NEAR = 0.1  # m; models this near to something that moves are simulated with it
SLOW = 0.03  # m/s
CALM = 0.3  # s; what was slow for so long is at rest
# Simulated time for the rehearsals of all models of a world that never come to rest, and the least for each of them, s.
BUDGET = 200.0
LEAST = 1.0


class Rehearsals:
    """Works out the scripts of piles in one plant, each that is not in the `repertoire` of its world."""

    def __init__(
        self,
        repertoire: Repertoire,
        built: Built,
        context: Context,
        presence: Presence,
        hold: Hold,
        clock: Clock,
        floor: float,
    ) -> None:
        """`floor` (m) is the height below which a model has fallen out of the world."""
        self._repertoire = repertoire
        self._built = built
        self._context = context
        self._plant_context = built.plant.GetMyMutableContextFromRoot(context)
        self._presence = presence
        self._hold = hold
        self._clock = clock
        self._floor = floor
        self._bodies = tuple(built.moving.values())
        # The same for every run in this world, whatever is kept: removing a model must not end the script of another.
        self._longest = max(LEAST, BUDGET / max(repertoire.moving, 1))
        hold.begin()
        self._apart, self._to_robot = self._start_gaps()

    def scripts(self, kept: Sequence[Body], present: frozenset[str]) -> list[Script]:
        """The scripts of all piles of `kept` that start away from the robot, where the models `present` are kept.

        To be called after `Presence.remove` of those which are not.
        """
        piles = self._piles({body.name for body in kept})
        found = [self._find(pile, present) for pile in piles]
        missing = [pile for pile, known in zip(piles, found, strict=True) if known is None]
        if missing:
            with self._presence.without_robot():
                for pile in missing:
                    self._rehearse(pile, present)
            found = [self._find(pile, present) for pile in piles]
        return [known.script for known in found if known is not None and known.script is not None]

    def _start_gaps(self) -> tuple[np.ndarray, np.ndarray]:
        """Between all moving models, and from each to the robot, as they start."""
        if not self._bodies:
            return np.empty((0, 0)), np.empty(0)
        links, robot = Links.of(self._bodies), Links.of([self._built.robot])
        plant = self._built.plant
        there = links.observe(plant, self._plant_context, range(len(links.bodies)))
        here = robot.observe(plant, self._plant_context, range(len(robot.bodies)))
        return gaps(links, there, links, there), gaps(robot, here, links, there)[0]

    def _piles(self, names: set[str]) -> list[tuple[Body, ...]]:
        """The models `names` in groups that start near each other, but for groups near the robot."""
        numbers = [number for number, body in enumerate(self._bodies) if body.name in names]
        joined = self._apart[np.ix_(numbers, numbers)] < NEAR
        left = ~spread(self._to_robot[numbers] < NEAR, joined)
        piles = []
        while left.any():
            one = np.zeros_like(left)
            one[left.argmax()] = True
            pile = spread(one, joined)
            piles.append(tuple(self._bodies[number] for number, member in zip(numbers, pile, strict=True) if member))
            left &= ~pile
        return piles

    def _find(self, pile: tuple[Body, ...], present: frozenset[str]) -> Known | None:
        return self._repertoire.find(_names(pile), present)

    def _rehearse(self, pile: tuple[Body, ...], present: frozenset[str]) -> None:
        script = self._simulate(pile)
        fastest = max(motion.speed.max() for motion in script.motions) if script else 0.0
        self._repertoire.add(_names(pile), present, script, NEAR + fastest * self._clock.period)

    def _simulate(self, pile: tuple[Body, ...]) -> Script | None:
        """The pile alone in the world, until all of it rests or it has had its time; None if the simulation breaks."""
        entries = self._hold.entries(pile)
        self._context.SetTime(0.0)
        self._hold.begin(others=(self._built.robot,))
        self._hold.release(entries, self._hold.start[entries])
        self._hold.apply()
        self._presence.join(pile, (), robot=False)
        try:
            return self._rows(pile, entries)
        # Drake raises SystemExit where a condition of its own failed.
        except (RuntimeError, ValueError, SystemExit):
            return None
        finally:
            self._presence.part(pile, ())

    def _rows(self, pile: tuple[Body, ...], entries: np.ndarray) -> Script:
        """Simulates what is released, and writes down the pile each time that something is due."""
        plant, links = self._built.plant, Links.of(pile)
        motors = plant.get_desired_state_input_port(self._built.robot.instance)
        motors.FixValue(self._plant_context, np.zeros(motors.size()))
        simulator = Simulator(self._built.diagram, self._context)
        everything = range(len(links.bodies))
        states = [self._hold.state()[entries]]
        motions, paces = [links.observe(plant, self._plant_context, everything)], [np.zeros(len(everything))]
        calm = 0.0
        for before, tick in pairwise(self._clock.ticks):
            simulator.AdvanceTo(tick.time)
            states.append(self._hold.state()[entries])
            if not np.isfinite(states[-1]).all():
                raise ValueError("not finite")
            seconds = (tick.step - before.step) * self._clock.step
            motions.append(links.observe(plant, self._plant_context, everything))
            paces.append(links.pace(everything, motions[-2], motions[-1], seconds))
            rests = ((paces[-1] < SLOW) | motions[-1].below(self._floor)).all()
            calm = calm + seconds if rests else 0.0
            self._hold.apply()
            if calm >= CALM or tick.time >= self._longest:
                break
        return Script(_names(pile), np.array(states), tuple(motions), tuple(paces), rests=calm >= CALM)


def _names(pile: Iterable[Body]) -> tuple[str, ...]:
    return tuple(body.name for body in pile)
