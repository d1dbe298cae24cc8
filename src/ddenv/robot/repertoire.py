"""The scripts that are known of one world's piles.

A pile moves alone in the same way, to the last bit, in every plant of the world: what was worked out in one is known in all.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from ddenv.robot.joints import anchored
from ddenv.robot.links import Motion
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
