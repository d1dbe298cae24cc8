"""What the learner sees of a model."""

from __future__ import annotations

import numpy as np
from scipy.spatial.distance import cdist

from ddenv.reduction.chance import distances_to_failure
from ddenv.reduction.evidence import Evidence, Partition, Traits

# Distances are seen on a scale on which 1 cm more at the failure counts as much as a metre far away, m.
NEAR = 0.1
# The scale on which the time of sensing is seen, s.
SOON = 10.0


def features(models: Partition, evidence: Evidence) -> np.ndarray:
    """One row for each model, shape (len(models), 9), all of the order of one; what is not known is 0.

    Distance to the end of f, mean and least distance to the path, how early it was sensed (1 at once, 0 never), whether it was
    sensed, whether it was touched, size, friction, whether it can move. Raises evidence.Lacking without positions or f's place.
    """
    rows = np.zeros((len(models), 9))
    rows[:, 0] = _scaled(distances_to_failure(models, evidence))
    if evidence.trajectory is not None:
        places, path = evidence.places(models), evidence.path()
        rows[:, 1] = _scaled(cdist(places, path).mean(axis=1))
        rows[:, 2] = _scaled(evidence.nearest(models)[:, 0])
    sensed = evidence.first_sensed or {}
    times = np.array([sensed.get(name, np.inf) for name in models])
    rows[:, 3] = np.exp(-times / SOON)
    rows[:, 4] = np.isfinite(times)
    rows[:, 5] = [name in (evidence.touched or ()) for name in models]
    traits = [(evidence.traits or {}).get(name, Traits()) for name in models]
    rows[:, 6] = np.log1p([each.size for each in traits])
    rows[:, 7] = np.log10(np.clip([each.friction for each in traits], 1e-3, 1e3))
    rows[:, 8] = [each.dynamic for each in traits]
    return rows


def _scaled(distances: np.ndarray) -> np.ndarray:
    return np.log(distances + NEAR)
