"""How likely each model is needed: before any test, and after some.

Models are taken to be needed independently of each other, and f to show when all that are needed are there. (As in "Probabilistic
Delta Debugging", Wang et al. 2021.)
"""

from __future__ import annotations

import numpy as np

from ddenv.reduction.evidence import Evidence, Partition

# Chances stay inside of these, so that no test can be impossible.
LEAST, MOST = 1e-6, 1.0 - 1e-6
# With nothing known of places each model is needed with this chance (Wang et al. 2021).
UNIFORM = 0.1
# How many needed models are expected in each e-fold of the distance's rank.
DENSITY = 0.5
# Rounds of messages between tests and models; half of each is what it was before, or they would swing to and fro.
SWEEPS = 12


def uniform_prior(environment: Partition) -> np.ndarray:
    """The same chance for each model, shape (len(environment),)."""
    return np.full(len(environment), UNIFORM)


def spatial_prior(environment: Partition, evidence: Evidence) -> np.ndarray:
    """The chance falls with one over the rank of a model's distance to the place of the failure, shape (len(environment),).

    It has no scale: the nearest three are as likely to hold a needed model as the nearest three to nine. What the robot touched
    ranks as near. Raises evidence.Lacking.
    """
    ranks = np.argsort(np.argsort(distances_to_failure(environment, evidence), kind="stable"), kind="stable")
    return np.clip(DENSITY / (1.0 + ranks), LEAST, MOST)


def distances_to_failure(environment: Partition, evidence: Evidence) -> np.ndarray:
    """How far each model's box may be from where f ended, shape (len(environment),), m. Raises evidence.Lacking."""
    end = np.array(evidence.need("failure_position"))
    apart = np.linalg.norm(evidence.places(environment) - end, axis=1)
    sizes = [evidence.traits[name].size for name in environment] if evidence.traits else np.zeros(len(environment))
    return np.maximum(apart - np.array(sizes) / 2, 0.0)


def beliefs(prior: np.ndarray, groups: np.ndarray, miss_chance: float = 0.0) -> np.ndarray:
    """The chances (M,) once it is known that f does not show without any one of some groups of models.

    `groups` (T, M) of bool: leaving out those of row t was tried, and f was not seen. `miss_chance` is the chance of that though
    none of them is needed. Loopy belief propagation: each test sends each of its models the odds that no other explains it.
    """
    groups = groups[groups.any(axis=1)]
    if not len(groups):
        return prior
    logit = np.log(prior) - np.log1p(-prior)
    messages = np.zeros(groups.shape)
    for _ in range(SWEEPS):
        # What each model would be believed without the word of the test that asks.
        odds = np.clip(logit + messages.sum(axis=0) - messages, -30.0, 30.0)
        spared = np.where(groups, -np.logaddexp(0.0, odds), 0.0)
        others = np.exp(spared.sum(axis=1, keepdims=True) - spared)
        unexplained = 1.0 - others + others * miss_chance
        messages = (messages + np.where(groups, -np.log(np.clip(unexplained, LEAST, 1.0)), 0.0)) / 2.0
    total = np.clip(logit + messages.sum(axis=0), -30.0, 30.0)
    return np.clip(1.0 / (1.0 + np.exp(-total)), LEAST, MOST)


def undominated(groups: np.ndarray) -> np.ndarray:
    """Which rows (K,) of `groups` (T, M) of bool are no supersets of another: a larger group than that tells nothing new.

    Of equal rows the first stays; empty ones never do.
    """
    _, firsts = np.unique(groups, axis=0, return_index=True)
    rows = np.sort(firsts[groups[firsts].any(axis=1)])
    wide = groups[rows].astype(np.float32)
    inside = wide @ wide.T >= wide.sum(axis=1)[None, :]
    np.fill_diagonal(inside, False)
    return rows[~inside.any(axis=1)]
