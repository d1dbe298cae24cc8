"""What partitioning and prioritization may look at."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

Partition = tuple[str, ...]


@dataclass(frozen=True)
class Evidence:
    """What is known of the world and of the last similar run in the current environment.

    `positions` maps a model to its position, x, y, z m. `trajectory` has shape (N, >= 4): time s, x, y, z m, ... of that run.
    `failure_position` is where f ended, x, y, z m. `seed` makes clustering and random orders repeatable.
    """

    positions: Mapping[str, tuple[float, float, float]]
    trajectory: np.ndarray
    failure_position: tuple[float, float, float]
    seed: int = 0

    def places(self, models: Partition) -> np.ndarray:
        """Positions of `models`, shape (len(models), 3), m."""
        return np.array([self.positions[name] for name in models], dtype=float).reshape(-1, 3)

    def centroid(self, models: Partition) -> np.ndarray:
        """Mean position of `models`, shape (3,), m."""
        return self.places(models).mean(axis=0)
