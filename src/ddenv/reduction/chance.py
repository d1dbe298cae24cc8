"""How likely each model is needed, before any test and after tests: independently of each other, and f shows whenever all needed
models are there ("Probabilistic Delta Debugging", Wang et al. 2021).
"""

from __future__ import annotations

import numpy as np

from ddenv.arrays import Booleans, Floats, Integers
from ddenv.reduction.evidence import Evidence, Names

# Probabilities stay between these, so that no test is impossible.
LEAST, MOST = 1e-6, 1.0 - 1e-6
# The prior without any positions (Wang et al. 2021).
UNIFORM = 0.1
# The expected number of needed models in each e-fold of the distance's rank.
DENSITY = 0.5
# Iterations of belief propagation, each damped by one half: else messages would oscillate.
SWEEPS = 12


def logit(chances: Floats) -> Floats:
    """The log odds of probabilities."""
    chances = np.clip(chances, LEAST, MOST)
    return np.log(chances) - np.log1p(-chances)


def sigmoid(logits: Floats) -> Floats:
    """The probabilities of log odds."""
    return np.clip(1.0 / (1.0 + np.exp(-np.clip(logits, -30.0, 30.0))), LEAST, MOST)


def spatial_prior(environment: Names, evidence: Evidence) -> Floats:
    """A probability that falls with the rank of a model's distance to the failure, as 1 / rank; shape (len(environment),). It has
    no scale. Raises evidence.Lacking.
    """
    ranks = np.argsort(np.argsort(distances_to_failure(environment, evidence), kind="stable"), kind="stable")
    return np.asarray(np.clip(DENSITY / (1.0 + ranks), LEAST, MOST))


def distances_to_failure(environment: Names, evidence: Evidence) -> Floats:
    """A lower bound of each model's distance from the end of f, shape (len(environment),), m. Raises evidence.Lacking."""
    end = np.array(evidence.need("failure_position"))
    apart = np.linalg.norm(evidence.places(environment) - end, axis=1)
    sizes = [evidence.traits[name].size for name in environment] if evidence.traits else np.zeros(len(environment))
    return np.asarray(np.maximum(apart - np.array(sizes) / 2, 0.0))


def beliefs(prior: Floats, groups: Booleans, miss_chance: float = 0.0) -> Floats:
    """The posterior probabilities (M,) of models, once tests have failed to show f without some groups of them.

    `groups` (T, M): test t left out the models in row t and did not show f. `miss_chance` is the probability of that if none of
    them is needed. Loopy belief propagation: each test sends each of its models the odds that no other model explains it.
    """
    groups = groups[groups.any(axis=1)]
    if not len(groups):
        return prior
    before = logit(prior)
    messages = np.zeros(groups.shape)
    for _ in range(SWEEPS):
        # The odds of each model without the message of the test that asks.
        odds = np.clip(before + messages.sum(axis=0) - messages, -30.0, 30.0)
        spared = np.where(groups, -np.logaddexp(0.0, odds), 0.0)
        others = np.exp(spared.sum(axis=1, keepdims=True) - spared)
        unexplained = 1.0 - others + others * miss_chance
        messages = (messages + np.where(groups, -np.log(np.clip(unexplained, LEAST, 1.0)), 0.0)) / 2.0
    return sigmoid(before + messages.sum(axis=0))


def undominated(groups: Booleans) -> Integers:
    """The rows (K,) of `groups` (T, M) that are not empty and no supersets of another row, which says more; of equal ones the
    first.
    """
    _, firsts = np.unique(groups, axis=0, return_index=True)
    rows = np.sort(firsts[groups[firsts].any(axis=1)])
    wide = groups[rows].astype(np.float32)
    inside = wide @ wide.T >= wide.sum(axis=1)[None, :]
    np.fill_diagonal(inside, False)
    minimal: Booleans = ~inside.any(axis=1)
    return rows[minimal]
