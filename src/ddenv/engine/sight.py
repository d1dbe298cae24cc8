"""What the schemas see of a run: where models are, the last similar run, and the results of all tests."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ddenv.engine.judging import end_of, known_failure
from ddenv.reduction.evidence import Evidence, Traits, Trial
from ddenv.runfile.state import RunState, Test
from ddenv.world.extent import center, model_bounds
from ddenv.world.model import Model, World
from ddenv.world.pose import headings


def trajectory_of(rows: np.ndarray) -> np.ndarray:
    """Rows of t (s), x, y, z (m), qw, qx, qy, qz as rows of t, x, y, z, yaw (rad): shape (N, 8) to (N, 5)."""
    return np.column_stack([rows[:, :4], headings(rows[:, 4:])])


def traits_of(model: Model) -> Traits:
    """What the learner knows about a model. The most slippery of its surfaces counts."""
    box = model_bounds(model)
    size = 0.0 if box is None else float((box[1] - box[0]).max())
    friction = min((collision.mu for collision in model.collisions), default=1.0)
    return Traits(size, friction, not model.static)


def _end(state: RunState, run: Test) -> tuple[float, float, float]:
    """Where f ended; if several failures count as f, the one that `run` showed."""
    ends = [end_of(state.tests[test - 1]) for test in state.failures]
    if run.end_pose is None:
        return ends[0]
    here = end_of(run)
    return min(ends, key=lambda end: math.dist(end, here))


class Sight:
    """The part of the evidence that comes from the world and never changes in a run."""

    def __init__(self, world: World, elements: Sequence[str], delta: float, seed: int) -> None:
        models = {model.name: model for model in world.models}
        self._elements = tuple(elements)
        self._positions = {name: center(models[name]) for name in elements}
        self._traits = {name: traits_of(models[name]) for name in elements}
        self._delta = delta
        self._seed = seed

    def evidence(self, state: RunState, test: int, rows: np.ndarray, trials: Sequence[Trial]) -> Evidence:
        """The evidence if `test` was the last similar run; `rows` (N, 8) is its trajectory."""
        run, f = state.tests[test - 1], known_failure(state)
        return Evidence(
            elements=self._elements,
            positions=self._positions,
            trajectory=trajectory_of(rows),
            failure_position=_end(state, run),
            first_sensed=dict(run.first_sensed),
            touched=frozenset(name for name, _ in run.first_touched),
            traits=self._traits,
            trials=trials,
            miss_chance=f.miss_chance,
            delta=self._delta,
            seed=self._seed,
        )
