"""Holds moving models in place, so that they cost little and change no bit of how the others move."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import cast

import numpy as np
from pydrake.systems.framework import Context

from ddenv.arrays import Booleans, Floats, Integers
from ddenv.robot.drake.articulation import to_drake
from ddenv.robot.drake.plant import Body, Built

# Held joints are kept this far inside their limits (rad or m): a joint at its limit is work for the solver.
INSIDE = 1e-6
# Where models wait that are not simulated: this far from each other along x, and this high, m.
APART, HIGH = 1e3, 1e5


class Hold:
    """The held models of one context: each at a fixed pose, with zero velocity and without weight.

    With their collisions filtered out (`Presence`) they are no part of the solver's problem.
    (`Joint.Lock` would do the same, but crashes Drake where static geometry is on the world body, drake#24773.)

    `start` (P + V,) are the plant's positions and velocities at the start of every run.
    """

    def __init__(self, built: Built, plant_context: Context, start: Floats) -> None:
        self._plant = built.plant
        self._context = plant_context
        self.start = start
        self._bodies = tuple(built.moving.values())
        self._count = built.plant.num_positions()
        self._held: Booleans = np.zeros(len(start), dtype=bool)
        self._changed = True
        self._state = start.copy()
        low = cast(Floats, built.plant.GetPositionLowerLimits())
        high = cast(Floats, built.plant.GetPositionUpperLimits())
        inside = np.minimum(INSIDE, (high - low) / 4)
        self._low, self._high = low + inside, high - inside
        self.away = start.copy()
        able = [built.robot, *(body for body in self._bodies if body.name in built.twins)]
        for number, body in enumerate(able):
            first = body.base.floating_positions_start()
            self.away[first + 4 : first + 7] = APART * (number + 1), 0.0, HIGH

    def entries(self, bodies: Iterable[Body]) -> Integers:
        """The indices (E,) of the positions and velocities of `bodies` in the plant's state."""
        plant, found = self._plant, []
        for body in bodies:
            positions = to_drake(np.arange(self._count, dtype=float))
            found.append(plant.GetPositionsFromArray(body.instance, positions))
            velocities = to_drake(np.arange(self._count, len(self.start), dtype=float))
            found.append(plant.GetVelocitiesFromArray(body.instance, velocities))
        return np.concatenate([np.empty(0), *found]).astype(int)

    def begin(self, others: Sequence[Body] = ()) -> None:
        """Puts everything where it starts, but all moving models and `others` away, where it holds them."""
        self._held[:] = False
        self.reset()
        entries = self.entries([*self._bodies, *others])
        self.put(entries, self.away[entries])
        self.apply()

    def reset(self) -> None:
        """Puts everything where it starts."""
        self._state[:] = self.start
        self._plant.SetPositionsAndVelocities(self._context, to_drake(self.start))

    def put(self, entries: Integers, values: Floats) -> None:
        """Holds `entries` (E,) of the state at the positions in `values` (E,), from the next `apply` on."""
        self._held[entries] = self._changed = True
        self._state[entries] = values
        self._state[: self._count] = np.clip(self._state[: self._count], self._low, self._high)
        self._state[self._count :] = 0.0

    def release(self, entries: Integers, values: Floats) -> None:
        """Lets `entries` (E,) of the state move again, starting from `values` (E,)."""
        self._held[entries] = False
        self._changed = True
        state = self.state()
        state[entries] = values
        self._plant.SetPositionsAndVelocities(self._context, to_drake(state))

    def state(self) -> Floats:
        """All positions and velocities, shape (P + V,)."""
        return cast(Floats, self._plant.GetPositionsAndVelocities(self._context))

    def apply(self) -> None:
        """Puts every held model in its place and cancels its weight.

        Call this at each tick. Free bodies would stay where they are to the last bit, but a model that stands upright on a
        joint is like a pencil on its tip: rounding alone would topple it within seconds.
        """
        if not (self._bodies or self._changed):
            return
        state, held = self.state(), self._held
        if not np.array_equal(state[held], self._state[held]):
            state[held] = self._state[held]
            self._plant.SetPositionsAndVelocities(self._context, to_drake(state))
        if self._changed:
            force = -cast(Floats, self._plant.CalcGravityGeneralizedForces(self._context))
            force[~self._held[self._count :]] = 0.0
            self._plant.get_applied_generalized_force_input_port().FixValue(self._context, force)
            self._changed = False
