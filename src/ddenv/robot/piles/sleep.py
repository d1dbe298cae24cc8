"""Which moving models are simulated: those that are near the robot or near something that moves.

All others are held where they are, or played back from a script (`rehearsal.py`): they cost little, do not creep, and change no
bit of what is simulated. So removing a model that takes no part leaves every bit of a run as it was.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ddenv.arrays import Booleans, Floats, Integers
from ddenv.robot.drake.plant import Body
from ddenv.robot.drake.run_context import RunContext
from ddenv.robot.piles.moving_links import Links, Motion, gaps, spread
from ddenv.robot.piles.rehearsal import CALM, NEAR, SLOW, Script
from ddenv.world.extent import Bounds

NO_BOXES = np.empty((0, 3)), np.empty((0, 3))
TOUCH = 0.02  # m; models this near to each other wake and fall asleep together


@dataclass(frozen=True)
class Situation:
    """What the rules look at: for each of M models (M,), or for each pair of them (M, M).

    `near` the robot; `met` by something that moves, so that both must be simulated together; `stirred` by something near that is
    not slow; `touching`, near enough to carry each other; `together`, moved by the same script.
    """

    near: Booleans
    met: Booleans
    stirred: Booleans
    touching: Booleans
    together: Booleans


class Sleep:
    """The moving models that are kept in one run. Each is awake (simulated), played back from a script, or asleep (held).

    Models without a script start awake. With `never` they stay awake.
    """

    def __init__(
        self, context: RunContext, kept: Sequence[Body], scripts: Sequence[Script], never: bool = False
    ) -> None:
        hold, clock = context.hold, context.clock
        self._plant = context.built.plant
        self._context = context.plant_context
        self._presence = context.presence
        self._hold = hold
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
        self._entries_of = [hold.entries([kept[number] for number in members]) for _, members in self._scripts]
        count = len(kept)
        self._awake: Booleans = np.zeros(count, dtype=bool)
        # Fallen out of the world.
        self._gone: Booleans = np.zeros(count, dtype=bool)
        # The number of the script that moves a model, or -1.
        self._played: Integers = np.full(count, -1)
        for number, (_, members) in enumerate(self._scripts):
            self._played[members] = number
        # Models whose script has ended although they still move.
        self._due: Booleans = np.zeros(count, dtype=bool)
        self._calm = np.zeros(count)  # s
        self._motion = Motion.still(len(self._links.bodies))
        self._pace = np.zeros(len(self._links.bodies))
        self._tick = 0
        self._now = 0
        hold.begin()
        self._wake(self._played < 0)
        hold.apply()

    def tick(self, step: int) -> None:
        """Applies the rules. Call it at each tick of the clock, from the start on; `step` is the plant's step."""
        if len(self._kept) and not self._never:
            seconds = (step - self._now) * self._step
            self._play()
            self._look(np.flatnonzero(self._awake), seconds)
            self._drop()
            self._decide(seconds)
        # Also when no moving model is kept: removed ones are held, too.
        self._hold.apply()
        self._tick += 1
        self._now = step

    def boxes(self) -> Bounds:
        """The lowest and the highest corners, (M, 3) m each, of the boxes around the kept models at the last tick."""
        if self._never:
            self._look(np.arange(len(self._kept)), 0.0)
        low, high = self._motion.low, self._motion.high
        return np.minimum.reduceat(low, self._links.first), np.maximum.reduceat(high, self._links.first)

    def awake_boxes(self) -> Bounds:
        """As `boxes`, for the models alone that are simulated."""
        if not self._awake.any():
            return NO_BOXES
        low, high = self.boxes()
        return low[self._awake], high[self._awake]

    def poses(self) -> tuple[Floats, Floats]:
        """The poses of all L links of the kept models at the last tick: places (L, 3) m and rotations (L, 3, 3)."""
        if self._never:
            self._look(np.arange(len(self._kept)), 0.0)
        return self._motion.places, self._motion.turns

    def end(self) -> None:
        """Leaves the context without any moving model that something could touch."""
        self._presence.part([body for body, awake in zip(self._kept, self._awake, strict=True) if awake], ())

    def _play(self) -> None:
        """Moves the models that are played back to where their scripts have them now."""
        for number, (script, members) in enumerate(self._scripts):
            if self._played[members[0]] != number:
                continue
            row = min(self._tick, len(script.motions) - 1)
            self._hold.put(self._entries_of[number], script.states[row])
            links = self._links.of_models(members)
            self._motion.put(links, script.motions[row])
            self._pace[links] = script.paces[row]
            if row == len(script.motions) - 1:
                self._due[members] = not script.rests
                self._played[members] = -1 if script.rests else number

    def _look(self, models: Integers, seconds: float) -> None:
        """Observes `models` (K,) in the simulation, `seconds` after the last time."""
        links = self._links.of_models(models)
        if not links:
            return
        before, now = self._motion.of(links), self._links.observe(self._plant, self._context, links)
        self._motion.put(links, now)
        if seconds:
            self._pace[links] = self._links.pace(links, before, now, seconds)

    def _drop(self) -> None:
        """Holds what has fallen out of the world: it is not worth simulating."""
        self._gone |= np.logical_and.reduceat(self._motion.below(self._floor), self._links.first)
        self._lay(self._awake & self._gone)

    def _decide(self, seconds: float) -> None:
        """Wakes models and lays others to sleep, `seconds` after the last time."""
        slow = np.maximum.reduceat(self._pace, self._links.first) < SLOW
        speed = np.maximum.reduceat(self._motion.speed, self._links.first)
        near = self._near(speed)
        if not (near.any() or self._awake.any() or (self._played >= 0).any()):
            return
        now = self._situation(speed, slow, near)
        start: Booleans = ~self._awake & (now.near | now.met | self._due)
        if start.any():
            self._wake(spread(start, now.touching | now.together) & ~self._awake & ~self._gone)
        self._calm = np.where(self._awake & slow, self._calm + seconds, 0.0)
        restless = self._awake & ((self._calm < CALM) | now.near | now.stirred)
        self._lay(self._awake & ~spread(restless, now.touching))

    def _near(self, speed: Floats) -> Booleans:
        """Which models could meet the robot before the tick after next; `speed` (M,) m/s."""
        robot = self._robot.observe(self._plant, self._context, range(len(self._robot.bodies)))
        reach = NEAR + (speed + robot.speed.max()) * self._period
        near: Booleans = (gaps(self._robot, robot, self._links, self._motion)[0] < reach) & ~self._gone
        return near

    def _situation(self, speed: Floats, slow: Booleans, near: Booleans) -> Situation:
        apart = gaps(self._links, self._motion, self._links, self._motion)
        apart[self._gone] = apart[:, self._gone] = np.inf
        np.fill_diagonal(apart, np.inf)
        played = self._played >= 0
        moving = self._awake | played
        lively: Booleans = moving & ~slow
        together = played[:, None] & (self._played[:, None] == self._played)
        touching: Booleans = apart < TOUCH
        stirring: Booleans = (apart < NEAR + (speed[:, None] + speed) * self._period) & (lively[:, None] | lively)
        meeting = (stirring | (touching & (moving[:, None] | moving))) & ~together
        stirred = np.asarray(stirring.any(axis=1))
        return Situation(near, meeting.any(axis=1), stirred, touching, together)

    def _wake(self, models: Booleans) -> None:
        """Lets the simulator move `models` (M,), starting from where they are now."""
        if not models.any():
            return
        state = self._hold.state()
        for number, (script, members) in enumerate(self._scripts):
            if models[members].any() and self._played[members[0]] == number:
                state[self._entries_of[number]] = script.states[self._tick]
                # Models that the script still moves but that are not woken have fallen out of the world.
                self._played[members] = -1
        for index in np.flatnonzero(models):
            self._hold.release(self._entries[index], state[self._entries[index]])
        self._presence.join(self._bodies(models), self._bodies(self._awake))
        self._awake |= models
        self._due &= ~models
        self._calm[models] = 0

    def _lay(self, models: Booleans) -> None:
        """Holds `models` (M,), which are awake, where they are now."""
        if not models.any():
            return
        state = self._hold.state()
        for number in np.flatnonzero(models):
            self._hold.put(self._entries[number], state[self._entries[number]])
        self._awake &= ~models
        self._presence.part(self._bodies(models), self._bodies(self._awake))
        links = self._links.of_models(np.flatnonzero(models))
        self._motion.speed[links] = self._pace[links] = 0.0

    def _bodies(self, models: Booleans) -> list[Body]:
        return [body for body, chosen in zip(self._kept, models, strict=True) if chosen]
