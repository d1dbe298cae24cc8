"""When a model lies still: over a while, since boards that lie across each other tremble and stay where they are."""

from __future__ import annotations

import numpy as np

from ddenv.arrays import Booleans
from ddenv.robot.piles.moving_links import Links, Motion

SLOW = 0.03  # m/s
CALM = 0.3  # s; a model that was slow for this long is at rest


class Stillness:
    """For how long each of M models has stayed where it is, up to the way that something slow makes in that time."""

    def __init__(self, links: Links) -> None:
        self._links = links
        count = len(links.bodies)
        self._places, self._turns = np.zeros((count, 3)), np.zeros((count, 3, 3))
        self._calm = np.zeros(len(links.first))  # s

    def look(self, motion: Motion, seconds: float) -> None:
        """Takes in where all links are, `seconds` after the last time."""
        self._calm += seconds
        self.restart(self.moved(motion), motion)

    def moved(self, motion: Motion) -> Booleans:
        """Which models (M,) have moved since their time was last counted anew."""
        way = np.linalg.norm(motion.places - self._places, axis=1)
        turn = np.linalg.norm(motion.turns - self._turns, axis=(1, 2)) / np.sqrt(2.0)
        moved: Booleans = np.maximum.reduceat(way + turn * self._links.reach, self._links.first) > SLOW * CALM
        return moved

    def restart(self, models: Booleans, motion: Motion) -> None:
        """Counts the time of `models` (M,) from now on."""
        links = self._links.of_models(np.flatnonzero(models))
        self._places[links], self._turns[links] = motion.places[links], motion.turns[links]
        self._calm[models] = 0.0

    @property
    def at_rest(self) -> Booleans:
        """Which models (M,) have been still for long enough."""
        rest: Booleans = self._calm >= CALM
        return rest
