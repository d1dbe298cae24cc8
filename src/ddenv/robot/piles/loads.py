"""What moving models press on those at rest: one at rest wakes when it would no longer stay where it is."""

from __future__ import annotations

from collections.abc import Sequence
from typing import cast

import numpy as np
from pydrake.multibody.plant import ContactResults

from ddenv.arrays import Booleans, Floats
from ddenv.robot.drake.context import RunContext
from ddenv.robot.drake.plant import Body

# A model at rest bears a change of its load up to this many times its own weight: it also carries others.
BEARS = 3.0
# One that a change of its load woke, and that came to rest again where it had lain, bears this many times that change.
BORE = 1.5
# A support carries if it takes this part of the model's weight; the model wakes when half of that is gone.
CARRIES = 0.1
LOST = 0.5
# Loads are means over this time, s: what lies on a point trembles.
SMOOTH = 0.2
GRAVITY = 9.81  # m/s^2; also in a world without gravity, where a model bears by its mass


class Loads:
    """The loads of M models in one run, from each of them and, last, from the robot."""

    def __init__(self, context: RunContext, models: Sequence[Body]) -> None:
        built, count = context.built, len(models)
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
        self._weights = GRAVITY * np.array([sum(link.default_mass() for link in body.links) for body in models])
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
        """Takes the loads of now as those at rest, between each of `asleep` (M,) and of `awake` (M,) that are new to each other."""
        pairs = asleep[:, None] & np.append(awake, True)
        new = pairs & ~self._known
        self._known = pairs
        if new.any():
            now = self._forces()
            self._at_rest[new] = self._mean[new] = now[new]

    def changed(self, seconds: float) -> Booleans:
        """Which models (M,) bear so much more, or are carried so much less, than at rest that they wake."""
        self._mean += min(1.0, seconds / SMOOTH) * (self._forces() - self._mean)
        change = np.where(self._known[..., None], self._mean - self._at_rest, 0.0).sum(axis=1)
        before, now = self._at_rest @ self._up, self._mean @ self._up
        lost = self._known & (before > CARRIES * self._weights[:, None]) & (now < LOST * before)
        self._change = np.linalg.norm(change, axis=1)
        woken: Booleans = (self._change > self._bears) | lost.any(axis=1)
        return woken

    def woke(self, models: Booleans, pressed: Booleans) -> None:
        """Takes in that `models` (M,) woke, those of them that are `pressed` (M,) by a change of their load."""
        self._woken_by[models] = np.where(pressed, self._change, 0.0)[models]

    def bore(self, models: Booleans) -> None:
        """Takes in that `models` (M,) came to rest where they lay before they woke."""
        self._bears[models] = np.maximum(self._bears, BORE * self._woken_by)[models]

    def _forces(self) -> Floats:
        """The force (M, M + 1, 3) on each model at rest from each moving one, N in the world frame."""
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
