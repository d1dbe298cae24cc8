"""Partitions by how likely models are needed, learnt from the tests of this run."""

from __future__ import annotations

import numpy as np

from ddenv.reduction.chance import LEAST, MOST, beliefs, spatial_prior
from ddenv.reduction.evidence import Evidence, Partition
from ddenv.reduction.features import features
from ddenv.reduction.lessons import Lessons
from ddenv.reduction.online import OnlineClassifier
from ddenv.reduction.partitionings.grouped import grouped

# After so many candidates the classifier's word counts as much as the spatial prior's.
TRUST = 10.0
# The chance that none of a group is needed is one half where its models' weights, -ln(1 - chance), add up to this.
EVEN = float(np.log(2.0))
# How far the chances may be moved as a whole, in log odds, and how far they may be drawn together (as in Platt's scaling).
SHIFTS = np.linspace(-3.0, 3.0, 13)
SLOPES = np.array([0.5, 0.75, 1.0, 1.25])


class Learner:
    """A classifier learns from every test of this run what needed models are like: near the failure or the path, early sensed,
    touched, large, slippery, able to move. Its chances are set right by how often tests showed the failure, joined with what the
    tests say of each model itself, and models of like chance make a partition: the likely ones few, the unlikely ones many. With
    no test yet, nearness to the failure is all it goes by.

    It remembers what it has learnt: one object serves one reduction.
    """

    def __init__(self) -> None:
        self._lessons = Lessons()
        self._classifier = OnlineClassifier()

    def __call__(self, environment: Partition, n_partitions: int, evidence: Evidence) -> list[Partition]:
        chances = self.chances(environment, evidence)
        # Sorted by chance, the least likely first; the order of the file between equals.
        order = np.argsort(chances, kind="stable")
        weights = -np.log1p(-chances[order])
        labels = np.empty(len(environment), dtype=int)
        labels[order] = -_shares(weights, n_partitions)
        return grouped(environment, labels)

    def chances(self, environment: Partition, evidence: Evidence) -> np.ndarray:
        """How likely each model is needed, shape (len(environment),). Learns from what was tested since the last time."""
        rows = features(environment, evidence)
        if not self._lessons.begun:
            self._classifier.see(rows)
        prior = spatial_prior(environment, evidence)
        self._lessons.take(environment, rows, prior, evidence.trials)
        if not self._lessons.count:
            return prior
        for samples, labels, weights in self._lessons.fresh(self._classifier.chances):
            self._classifier.learn(samples, labels, weights, evidence.seed)
        logits = _logit(prior) + self._learnt(rows)
        gone = _logit(self._lessons.gone_prior) + self._learnt(self._lessons.gone_rows)
        groups = self._lessons.groups(environment)
        slope, shift = _scaling(logits, gone, groups)
        chances = _sigmoid(slope * logits + shift)
        return beliefs(chances, groups, evidence.miss_chance)

    def _learnt(self, rows: np.ndarray) -> np.ndarray:
        """By how much the classifier moves the log odds of models with the features `rows` (M, F), shape (M,)."""
        return self._lessons.count / (self._lessons.count + TRUST) * _logit(self._classifier.chances(rows))


def _shares(weights: np.ndarray, n: int) -> np.ndarray:
    """The number of the group of each model, 0 to n - 1; `weights` are in rising order.

    All but the last group, which is left with the likeliest models, are as large as can be for even chances that none of them is
    needed; with little weight in all, they share it.
    """
    share = min(EVEN, float(weights.sum()) / n)
    before = np.cumsum(weights) - weights
    # A model that would take its group over the share begins the next one.
    return np.minimum(np.floor(before / share + 0.5), n - 1).astype(int)


def _scaling(logits: np.ndarray, gone: np.ndarray, groups: np.ndarray) -> tuple[float, float]:
    """Which slope and shift of all log odds make the tests' outcomes likeliest (with a weak wish for 1 and 0).

    `gone` (G,) are the log odds of models that turned out not to be needed, `groups` (T, M) those of which one is.
    """
    slopes, shifts = (grid.ravel() for grid in np.meshgrid(SLOPES, SHIFTS, indexing="ij"))
    spared = -np.logaddexp(0.0, np.outer(logits, slopes) + shifts)
    some_needed = -np.expm1(groups.astype(float) @ spared)
    scores = np.log(np.clip(some_needed, LEAST, 1.0)).sum(axis=0)
    scores -= np.logaddexp(0.0, np.outer(gone, slopes) + shifts).sum(axis=0)
    scores -= 0.5 * shifts**2 + 2.0 * np.log(slopes) ** 2
    best = int(np.argmax(scores))
    return float(slopes[best]), float(shifts[best])


def _logit(chances: np.ndarray) -> np.ndarray:
    chances = np.clip(chances, LEAST, MOST)
    return np.log(chances) - np.log1p(-chances)


def _sigmoid(logits: np.ndarray) -> np.ndarray:
    return np.clip(1.0 / (1.0 + np.exp(-np.clip(logits, -30.0, 30.0))), LEAST, MOST)
