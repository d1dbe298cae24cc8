"""How a pile moves while nobody comes near it."""

from __future__ import annotations

from dataclasses import dataclass

from ddenv.arrays import Booleans, Floats
from ddenv.robot.piles.moving_links import Motion

# What an array takes besides its numbers, bytes.
ARRAY = 128


@dataclass(frozen=True)
class Script:
    """How a pile of K models moves alone, with a row for each tick of the clock.

    `names` are its models in the order of the world file. `states` (T, E) are the pile's positions and velocities in the order of
    `Hold.entries`; `motions` and `paces` (T of each; `Links.pace`, m/s) are those of its links. `resting` (K,) are the models that
    are at rest after the last row, or have fallen out of the world.
    """

    names: tuple[str, ...]
    states: Floats
    motions: tuple[Motion, ...]
    paces: tuple[Floats, ...]
    resting: Booleans

    @property
    def size(self) -> int:
        """About how much memory it takes, bytes."""
        arrays = [self.states, *self.paces, *(part for motion in self.motions for part in vars(motion).values())]
        return sum(array.nbytes + ARRAY for array in arrays)
