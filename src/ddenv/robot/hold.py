"""Keeps moving models where they are while the simulator works on the others."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
from pydrake.systems.framework import Context

from ddenv.robot.plant import Body, Built

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
