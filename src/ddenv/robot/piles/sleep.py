"""Which moving models are simulated: those that the robot or something that moves reaches.

All others lie where they are as part of the ground (`Twins`), or are played back from a script
(`pile_simulator.py`): they cost little, do not creep, and change no bit of what does not touch
them. So removing a model that does not affect a run leaves every bit of a run as it was. A model at
rest wakes by itself, not with its neighbours: by a robot that comes close, by what presses on it,
by a support that goes.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import cast

import numpy as np
from pydrake.multibody.plant import ContactResults

from ddenv.arrays import Booleans, Floats, Integers
from ddenv.robot.drake.plant import Body
from ddenv.robot.drake.run_context import RunContext
from ddenv.robot.piles.motion import (
    NEAR,
    SLOW,
    Links,
    Motion,
    PileMotion,
    Stillness,
    gaps,
    spread,
    tight_gaps,
)
from ddenv.world.extent import Bounds

TOUCH = 0.02  # m; models this near to each other may touch
# A model at rest wakes when the robot is this near, m: it has a twin that the robot can touch.
CLOSE = 0.01
FAST = 0.1  # m/s, the mean speed of what wakes all that it reaches
PASSED = 0.02  # m; a robot that has moved less since a model fell asleep beside it does not wake it


class Sleep:
    """The moving models that are kept in one run. Each is awake (simulated), played back from a
    script, or asleep.

    Models without a script start awake. With `never` they stay awake. With `alone` the robot waits
    away from everything.

    Models that hang on the world, or that touch themselves, have no twin: asleep, they are held and
    nothing touches them. So they wake and fall asleep with what is near.
    """

    def __init__(
        self,
        context: RunContext,
        kept: Sequence[Body],
        scripts: Sequence[PileMotion],
        never: bool = False,
        alone: bool = False,
    ) -> None:
        hold = context.hold
        clock = context.clock
        self._plant = context.built.plant
        self._context = context.plant_context
        self._presence = context.presence
        self._hold = hold
        self._twins = context.twins
        self._period = clock.period
        self._step = clock.step
        self._floor = context.floor
        self._kept = kept
        self._never = never
        self._links = Links.of(kept)
        self._robot = Links.of([context.built.robot])
        self._entries = [hold.entries([body]) for body in kept]
        number_of = {body.name: number for number, body in enumerate(kept)}
        self._scripts = [(script, [number_of[name] for name in script.names]) for script in scripts]
        self._entries_of = [
            hold.entries([kept[number] for number in members]) for _, members in self._scripts
        ]
        self._has_twin: Booleans = np.array(
            [body.name in context.built.twins for body in kept], dtype=bool
        )
        # The state of what is not simulated, where it really is.
        self._real = hold.start.copy()
        self._away: Booleans = np.zeros(len(hold.start), dtype=bool)
        count = len(kept)
        # Which models are simulated, have fallen out of the world, or still move although their
        # script has ended.
        self._awake, self._gone, self._due, self._took_part = np.zeros((4, count), dtype=bool)
        # The number of the script that moves a model, or -1.
        self._played: Integers = np.full(count, -1)
        for number, (_, members) in enumerate(self._scripts):
            self._played[members] = number
        # Of all L links of the kept models at the last tick, and their mean speeds (L,) since the
        # one before, m/s.
        self.motion = Motion.still(len(self._links.bodies))
        self.pace = np.zeros(len(self._links.bodies))
        self._stillness = Stillness(self._links)
        # Where models were when they woke last.
        self._when_woken = Stillness(self._links)
        self._loads = Loads(context, kept)
        # Where the robot was (M, 12) when each model last woke, or was awake, beside it, m.
        self._robot_was = np.full((count, 12), np.inf)
        self._tick = self._now = 0
        hold.begin(others=[context.built.robot] if alone else ())
        self._twins.lift_all()
        for entries in self._entries:
            self._away[entries] = True
        self._wake(self._played < 0)
        hold.apply()

    def tick(self, step: int) -> None:
        """Applies the rules. Call it at each tick of the clock, from the start on; `step` is the
        plant's step.
        """
        if self._never:
            self._look(np.arange(len(self._kept)), 0.0)
        elif len(self._kept):
            seconds = (step - self._now) * self._step
            self._play()
            self._look(np.flatnonzero(self._awake), seconds)
            # What has fallen out of the world is not worth simulating.
            self._gone |= np.logical_and.reduceat(self.motion.below(self._floor), self._links.first)
            self._lay(self._awake & self._gone)
            self._decide(seconds)
        # Also when no moving model is kept: removed ones are held, too.
        self._hold.apply()
        self._tick += 1
        self._now = step

    def boxes(self) -> Bounds:
        """The lowest and the highest corners, (M, 3) m each, of the boxes around the kept models at
        the last tick.
        """
        low = self.motion.low
        high = self.motion.high
        return np.minimum.reduceat(low, self._links.first), np.maximum.reduceat(
            high, self._links.first
        )

    def awake_links(self) -> tuple[Floats, Floats, Floats]:
        """The K links that are simulated, at the last tick: corners (K, 3) m and (K, 3) m of the
        boxes around them, and bounds of their speeds (K,), m/s.
        """
        links = self._links.of_models(np.flatnonzero(self._awake))
        return self.motion.low[links], self.motion.high[links], self.motion.speed[links]

    @property
    def took_part(self) -> frozenset[str]:
        """The kept models that were simulated, or were perhaps touched by the robot or by what
        was.
        """
        return frozenset(body.name for body in self._bodies(self._took_part))

    def state(self) -> Floats:
        """The plant's positions and velocities (P + V,), with everything where it really is."""
        return np.where(self._away, self._real, self._hold.state())

    @property
    def at_rest(self) -> Booleans:
        """Which of the kept models (M,) are neither simulated nor played back."""
        return ~self._awake & (self._played < 0)

    def end(self) -> None:
        """Leaves the context without any moving model that something could touch."""
        self._twins.lift_all()
        self._presence.part(
            [body for body, awake in zip(self._kept, self._awake, strict=True) if awake], ()
        )

    def _play(self) -> None:
        """Moves the models that are played back to where their scripts have them now."""
        for number, (script, members) in enumerate(self._scripts):
            if self._played[members[0]] != number:
                continue
            row = min(self._tick, len(script.motions) - 1)
            links = self._links.of_models(members)
            self._real[self._entries_of[number]] = script.states[row]
            self.motion.put(links, script.motions[row])
            self.pace[links] = script.paces[row]
            self._hold_still(member for member in members if not self._has_twin[member])
            if row == len(script.motions) - 1:
                self._played[members] = -1
                self._due[members] = ~script.resting
                self._settle(np.array(members)[script.resting])

    def _settle(self, models: Integers) -> None:
        """Makes the ground of `models` (K,), which rest from now on."""
        for number in models:
            if self._has_twin[number] and not self._gone[number]:
                links = self._links.of_models([number])
                self._twins.lay(
                    self._kept[number], self.motion.places[links], self.motion.turns[links]
                )

    def _hold_still(self, models: Iterable[int]) -> None:
        """Holds the bodies of `models`: away from everything, or where they are if they have no
        twin.
        """
        for number in models:
            entries = self._entries[number]
            self._hold.put(
                entries, (self._hold.away if self._has_twin[number] else self._real)[entries]
            )

    def _look(self, models: Integers, seconds: float) -> None:
        """Observes `models` (K,) in the simulation, `seconds` after the last time."""
        links = self._links.of_models(models)
        if not links:
            return
        before = self.motion.of(links)
        now = self._links.observe(self._plant, self._context, links)
        self.motion.put(links, now)
        if seconds:
            self.pace[links] = self._links.ways(links, before, now) / seconds

    def _decide(self, seconds: float) -> None:
        """Wakes models and lays others to sleep, `seconds` after the last time."""
        slow = np.maximum.reduceat(self.pace, self._links.first) < SLOW
        speed = np.maximum.reduceat(self.motion.speed, self._links.first)
        near, close = self._near(speed)
        played = self._played >= 0
        moving = self._awake | played
        if not (near | close | moving | self._due).any():
            return
        apart = gaps(self._links, self.motion, self._links, self.motion)
        apart[self._gone] = apart[:, self._gone] = np.inf
        np.fill_diagonal(apart, np.inf)
        # Pairs (M, M): moved by the same script; near enough to carry each other; near, and one of
        # them is not slow.
        together = played[:, None] & (self._played[:, None] == self._played)
        touching: Booleans = apart < TOUCH
        lively: Booleans = moving & ~slow
        stirring: Booleans = (apart < NEAR + (speed[:, None] + speed) * self._period) & (
            lively[:, None] | lively
        )
        meeting = (stirring | (touching & (moving[:, None] | moving))) & ~together
        # What lies as part of the ground can be touched there: only what comes fast wakes it before
        # it does.
        met: Booleans = meeting.any(axis=1) & ~self._settled | self._struck(apart)
        # Something that is simulated may touch it before the tick after next.
        beside = (
            apart[:, self._awake] < TOUCH + (speed[:, None] + speed[self._awake]) * self._period
        )
        self._took_part |= near | beside.any(axis=1)
        self._stillness.look(self.motion, seconds)
        within = self._settled & (near | touching[:, self._awake].any(axis=1))
        pressed = self._loads.changed(seconds) if within.any() else np.zeros_like(within)
        start: Booleans = ~self._awake & (close | met | self._due | (pressed & self._settled))
        # What wakes another model, or keeps it awake, takes part although it stays asleep.
        self._took_part |= meeting[:, start | (self._awake & ~self._has_twin)].any(axis=1)
        if start.any():
            self._loads.woke(start, pressed)
            # What has no twin cannot stay asleep beside what wakes.
            joined = together | (touching & ~self._has_twin[:, None])
            self._wake(spread(start, joined) & ~self._awake & ~self._gone)
        rests = self._stillness.at_rest
        restless = self._awake & (~rests | (~self._has_twin & (close | stirring.any(axis=1))))
        joined = touching & self._awake[:, None] & self._awake
        self._lay(self._awake & np.where(self._has_twin, rests, ~spread(restless, joined)))
        if within.any() or start.any():
            self._loads.note(self._settled, self._awake)

    @property
    def _settled(self) -> Booleans:
        """Which models (M,) lie as part of the ground."""
        return self._has_twin & self.at_rest & ~self._gone

    def _near(self, speed: Floats) -> tuple[Booleans, Booleans]:
        """Which models the robot may touch, and which it would wake before the tick after next;
        `speed` (M,) m/s.
        """
        robot = self._robot.observe(self._plant, self._context, range(len(self._robot.bodies)))
        # Its wheels turn, but do not come nearer by that.
        margin = (speed + robot.speed[0]) * self._period
        wanted = gaps(self._robot, robot, self._links, self.motion) < NEAR + margin
        apart = tight_gaps(self._robot, robot, self._links, self.motion, wanted)[0]
        place = np.concatenate(
            [robot.places[0], (robot.turns[0] * self._robot.reach[0] / np.sqrt(2.0)).ravel()]
        )
        passing = np.linalg.norm(self._robot_was - place, axis=1) > PASSED
        lies = self._settled
        close: Booleans = (
            (apart < np.where(lies, CLOSE, NEAR) + margin) & (passing | ~lies) & ~self._gone
        )
        self._robot_was[close | self._awake] = place
        near: Booleans = (apart < TOUCH + margin) & ~self._gone
        return near, close

    def _struck(self, apart: Floats) -> Booleans:
        """Which models (M,) that lie as part of the ground something fast reaches before the tick
        after next.
        """
        pace = np.maximum.reduceat(self.pace, self._links.first)
        reach = CLOSE + pace * self._period
        wanted = self._settled[:, None] & (self._awake & (pace > FAST)) & (apart < reach)
        if not wanted.any():
            return np.zeros_like(self._awake)
        tight = tight_gaps(self._links, self.motion, self._links, self.motion, wanted)
        return np.asarray((tight < reach).any(axis=1))

    def _wake(self, models: Booleans) -> None:
        """Lets the simulator move `models` (M,), starting from where they are now."""
        if not models.any():
            return
        for index in np.flatnonzero(models):
            self._hold.release(self._entries[index], self._real[self._entries[index]])
            self._away[self._entries[index]] = False
        for number, (_, members) in enumerate(self._scripts):
            if models[members].any() and self._played[members[0]] == number:
                # Models that the script still moves but that are not woken have fallen out of the
                # world.
                self._played[members] = -1
        self._twins.lift(self._bodies(models))
        self._presence.join(self._bodies(models), self._bodies(self._awake))
        self._awake |= models
        self._took_part |= models
        self._due &= ~models
        self._stillness.restart(models, self.motion)
        self._when_woken.restart(models, self.motion)

    def _lay(self, models: Booleans) -> None:
        """Holds `models` (M,), which are awake, where they are now."""
        if not models.any():
            return
        self._loads.bore(models & ~self._when_woken.moved(self.motion))
        numbers = np.flatnonzero(models)
        entries = np.concatenate([self._entries[number] for number in numbers])
        self._real[entries] = self._hold.state()[entries]
        self._real[entries[entries >= self._plant.num_positions()]] = 0.0
        self._away[entries] = True
        self._awake &= ~models
        self._hold_still(numbers)
        self._settle(numbers)
        self._presence.part(self._bodies(models), self._bodies(self._awake))
        links = self._links.of_models(numbers)
        self.motion.speed[links] = self.pace[links] = 0.0

    def _bodies(self, models: Booleans) -> list[Body]:
        return [body for body, chosen in zip(self._kept, models, strict=True) if chosen]


# A model at rest bears a change of its load up to this many times its own weight: it also carries
# others.
BEARS = 3.0
# One that a change of its load woke, and that came to rest again where it had lain, bears this many
# times that change.
BORE = 1.5
# A support carries if it takes this part of the model's weight; the model wakes when half of that
# is gone.
CARRIES = 0.1
LOST = 0.5
# Loads are means over this time, s: what lies on a point trembles.
SMOOTH = 0.2
GRAVITY = 9.81  # m/s^2; also in a world without gravity, where a model bears by its mass


class Loads:
    """The loads of M models in one run, from each of them and, last, from the robot."""

    def __init__(self, context: RunContext, models: Sequence[Body]) -> None:
        built = context.built
        count = len(models)
        self._context = context.plant_context
        self._port = built.plant.get_contact_results_output_port()
        movers = [*(body.geometry for body in models), built.robot.geometry]
        self._mover = {shape: number for number, shapes in enumerate(movers) for shape in shapes}
        self._twin = {
            shape: number
            for number, body in enumerate(models)
            if body.name in built.twins
            for shape in built.twins[body.name].geometry
        }
        self._weights = GRAVITY * np.array(
            [sum(link.default_mass() for link in body.links) for body in models]
        )
        down = cast(Floats, built.plant.gravity_field().gravity_vector())
        self._up = -down / max(float(np.linalg.norm(down)), 1e-9)
        self._bears = BEARS * self._weights
        # How much its load had changed when a model woke last, N; 0 if something else woke it.
        self._change = np.zeros(count)
        self._woken_by = np.zeros(count)
        self._known: Booleans = np.zeros((count, count + 1), dtype=bool)
        self._at_rest = np.zeros((count, count + 1, 3))
        self._mean = np.zeros((count, count + 1, 3))

    def note(self, asleep: Booleans, awake: Booleans) -> None:
        """Takes the loads of now as those at rest, between each of `asleep` (M,) and of `awake`
        (M,) that are new to each other.
        """
        pairs = asleep[:, None] & np.append(awake, True)
        new = pairs & ~self._known
        self._known = pairs
        if new.any():
            now = self._forces()
            self._at_rest[new] = self._mean[new] = now[new]

    def changed(self, seconds: float) -> Booleans:
        """Which models (M,) bear so much more, or are carried so much less, than at rest that they
        wake.
        """
        self._mean += min(1.0, seconds / SMOOTH) * (self._forces() - self._mean)
        change = np.where(self._known[..., None], self._mean - self._at_rest, 0.0).sum(axis=1)
        before = self._at_rest @ self._up
        now = self._mean @ self._up
        lost = self._known & (before > CARRIES * self._weights[:, None]) & (now < LOST * before)
        self._change = np.linalg.norm(change, axis=1)
        return (self._change > self._bears) | lost.any(axis=1)

    def woke(self, models: Booleans, pressed: Booleans) -> None:
        """Takes in that `models` (M,) woke, those of them that are `pressed` (M,) by a change of
        their load.
        """
        self._woken_by[models] = np.where(pressed, self._change, 0.0)[models]

    def bore(self, models: Booleans) -> None:
        """Takes in that `models` (M,) came to rest where they lay before they woke."""
        self._bears[models] = np.maximum(self._bears, BORE * self._woken_by)[models]

    def _forces(self) -> Floats:
        """The force (M, M + 1, 3) on each model at rest from each moving one, N in the world
        frame.
        """
        results = cast(ContactResults, self._port.Eval(self._context))
        forces = np.zeros_like(self._mean)
        for number in range(results.num_point_pair_contacts()):
            contact = results.point_pair_contact_info(number)
            pair = contact.point_pair()
            # Drake gives the force on B.
            if pair.id_B in self._twin and pair.id_A in self._mover:
                forces[self._twin[pair.id_B], self._mover[pair.id_A]] += contact.contact_force()
            elif pair.id_A in self._twin and pair.id_B in self._mover:
                forces[self._twin[pair.id_A], self._mover[pair.id_B]] -= contact.contact_force()
        return forces
