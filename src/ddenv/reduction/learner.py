"""The partitioning `learner`: groups models by how likely they are needed, learnt from all tests of
this reduction.
"""

from __future__ import annotations

import warnings

import numpy as np
from scipy.spatial.distance import cdist
from sklearn.linear_model import SGDClassifier

from ddenv.arrays import Booleans, Floats, Integers
from ddenv.reduction.evidence import (
    LEAST,
    MOST,
    Evidence,
    Traits,
    distances_to_failure,
    spatial_prior,
)
from ddenv.reduction.partitionings import grouped
from ddenv.text import Names

# After this number of candidates the classifier counts as much as the spatial prior.
TRUST = 10.0
# With this sum of weights, -ln(1 - probability), a group contains no needed model with probability
# one half.
EVEN = float(np.log(2.0))
# Keeps the classifier's weights small while there are few tests.
REGULARIZATION = 0.01
# Iterations of belief propagation, each damped by one half: else messages would oscillate.
SWEEPS = 12
# The grid of Platt scaling: shifts of all log odds, and slopes.
SHIFTS = np.linspace(-3.0, 3.0, 13)
SLOPES = np.array([0.5, 0.75, 1.0, 1.25])


class Learner:
    """A classifier learns from every test of this reduction what needed models look like: near the
    failure or the path, sensed early, touched, large, slippery, able to move. Its probabilities are
    calibrated by how often tests showed the failure, and combined with what the tests say about
    each model itself. Models of similar probability make a partition: few likely ones, or many
    unlikely ones. Before the first test it uses only the distance to the failure.

    It remembers what it has learnt: one object serves one reduction. Each candidate is one lesson,
    however many models it left out: removed models were not needed; of the models that a candidate
    without f left out, at least one is needed.
    """

    def __init__(self) -> None:
        # Logistic regression by stochastic gradient descent: the probability that a model is
        # needed.
        self._classifier: SGDClassifier | None = None
        # The models of the first environment, N in all: their features (N, F) and priors (N,), of a
        # removed one as they were last.
        self._columns: dict[str, int] = {}
        self._rows = np.zeros((0, 0))
        self._prior = np.zeros(0)
        self._there = np.zeros(0, dtype=bool)
        # The scale of each feature (F,).
        self._mean = self._spread = np.zeros(0)
        # Tests that still say something: which models (T, N) each of them left out.
        self._failed = np.zeros((0, 0), dtype=bool)
        # How many trials were looked at, and how many candidates taught something.
        self._taken = self._lessons = 0

    def __call__(self, environment: Names, n_partitions: int, evidence: Evidence) -> list[Names]:
        chances = self.chances(environment, evidence)
        # By probability, the least likely first; equals in the order of the file.
        order = np.argsort(chances, kind="stable")
        weights = -np.log1p(-chances[order])
        labels = np.empty(len(environment), dtype=int)
        # Each group but the last contains no needed model with even odds; the last gets the
        # likeliest. If the total weight is small, all groups get an equal share of it. A model that
        # would exceed the share begins the next group.
        share = min(EVEN, float(weights.sum()) / n_partitions)
        before = np.cumsum(weights) - weights
        labels[order] = -np.minimum(np.floor(before / share + 0.5), n_partitions - 1).astype(int)
        return grouped(environment, labels)

    def chances(self, environment: Names, evidence: Evidence) -> Floats:
        """The probability that each model is needed, shape (len(environment),). Learns from the
        tests since the last call.
        """
        rows = features(environment, evidence)
        prior = spatial_prior(environment, evidence)
        if not self._columns:
            count = len(environment)
            spread = rows.std(axis=0)
            self._columns = {name: column for column, name in enumerate(environment)}
            self._rows = np.zeros_like(rows)
            self._prior = np.zeros(count)
            self._there = np.ones(count, dtype=bool)
            self._mean = rows.mean(axis=0)
            self._spread = np.where(spread > 1e-9, spread, 1.0)
            self._failed = np.zeros((0, count), dtype=bool)
        here = [self._columns[name] for name in environment]
        self._rows[here] = (rows - self._mean) / self._spread
        self._prior[here] = prior
        self._learn(here, evidence)
        if not self._lessons:
            return prior
        trust = self._lessons / (self._lessons + TRUST)
        logits = logit(self._prior) + trust * logit(self._classified(self._rows))
        # A superset of another group never says anything new.
        telling = undominated(self._failed[:, here])
        self._failed = self._failed[telling]
        groups = self._failed[:, here]
        slope, shift = _scaling(logits[here], logits[~self._there], groups)
        return beliefs(sigmoid(slope * logits[here] + shift), groups, evidence.miss_chance)

    def _learn(self, here: list[int], evidence: Evidence) -> None:
        """Learns from the models that went since the last call, and from new candidates without
        f.
        """
        there = np.zeros(len(self._columns), dtype=bool)
        there[here] = True
        gone = self._there & ~there
        self._there = there
        fresh = evidence.trials[self._taken :]
        self._taken = len(evidence.trials)
        similar = {trial.models for trial in fresh if trial.similar}
        failed = dict.fromkeys(trial.models for trial in fresh if trial.models not in similar)
        lacks = np.array(
            [[name not in models for name in self._columns] for models in failed], dtype=bool
        )
        self._failed = np.vstack([self._failed, lacks.reshape(-1, len(self._columns))])
        groups = [group for models in lacks if len(group := self._rows[models & there])]
        if count := int(gone.sum()):
            self._teach(
                self._rows[gone],
                np.zeros(count, dtype=int),
                np.full(count, 1.0 / count),
                evidence.seed,
            )
        for group in groups:
            # The blame within a group is shared as the classifier has it now.
            needed = np.clip(self._classified(group), LEAST, MOST)
            blame = needed / needed.sum()
            weights = np.append(blame, (1.0 - blame) / max(1, len(group) - 1))
            self._teach(
                np.vstack([group, group]), np.repeat([1, 0], len(group)), weights, evidence.seed
            )
        self._lessons += len(groups) + bool(count)

    def _teach(self, samples: Floats, labels: Integers, weights: Floats, seed: int) -> None:
        """One step from `samples` (K, F) with `labels` (K,), 1 for needed, and `weights` (K,)."""
        if self._classifier is None:
            self._classifier = SGDClassifier(
                loss="log_loss", alpha=REGULARIZATION, average=True, random_state=seed
            )
        with warnings.catch_warnings():
            # Early on there may be one label only, about which scikit-learn warns.
            warnings.simplefilter("ignore")
            self._classifier.partial_fit(samples, labels, classes=[0, 1], sample_weight=weights)

    def _classified(self, samples: Floats) -> Floats:
        """The classifier's probability for each of `samples` (K, F), shape (K,); one half before it
        has learnt anything.
        """
        known = self._classifier
        if known is None:
            return np.full(len(samples), 0.5)
        return np.asarray(known.predict_proba(samples)[:, 1])


def _scaling(logits: Floats, gone: Floats, groups: Booleans) -> tuple[float, float]:
    """The slope and shift of all log odds that maximize the likelihood of the tests (Platt scaling,
    with a weak prior at 1 and 0).

    `gone` (G,) are the log odds of models that were not needed; of each row of `groups` (T, M) at
    least one model is needed.
    """
    slopes, shifts = (grid.ravel() for grid in np.meshgrid(SLOPES, SHIFTS, indexing="ij"))
    spared = -np.logaddexp(0.0, np.outer(logits, slopes) + shifts)
    some_needed = -np.expm1(groups.astype(float) @ spared)
    scores = np.log(np.clip(some_needed, LEAST, 1.0)).sum(axis=0)
    scores -= np.logaddexp(0.0, np.outer(gone, slopes) + shifts).sum(axis=0)
    scores -= 0.5 * shifts**2 + 2.0 * np.log(slopes) ** 2
    best = int(np.argmax(scores))
    return float(slopes[best]), float(shifts[best])


def logit(chances: Floats) -> Floats:
    """The log odds of probabilities."""
    chances = np.clip(chances, LEAST, MOST)
    return np.log(chances) - np.log1p(-chances)


def sigmoid(logits: Floats) -> Floats:
    """The probabilities of log odds."""
    return np.clip(1.0 / (1.0 + np.exp(-np.clip(logits, -30.0, 30.0))), LEAST, MOST)


def beliefs(prior: Floats, groups: Booleans, miss_chance: float = 0.0) -> Floats:
    """The posterior probabilities (M,) of models, once tests have failed to show f without some
    groups of them.

    `groups` (T, M): test t left out the models in row t and did not show f. `miss_chance` is the
    probability of that if none of them is needed. Loopy belief propagation: each test sends each of
    its models the odds that no other model explains it.
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
        messages = (
            messages + np.where(groups, -np.log(np.clip(unexplained, LEAST, 1.0)), 0.0)
        ) / 2.0
    return sigmoid(before + messages.sum(axis=0))


def undominated(groups: Booleans) -> Integers:
    """The rows (K,) of `groups` (T, M) that are not empty and no supersets of another row, which
    says more; of equal ones the first.
    """
    _, firsts = np.unique(groups, axis=0, return_index=True)
    rows = np.sort(firsts[groups[firsts].any(axis=1)])
    wide = groups[rows].astype(np.float32)
    inside = wide @ wide.T >= wide.sum(axis=1)[None, :]
    np.fill_diagonal(inside, False)
    minimal: Booleans = ~inside.any(axis=1)
    return rows[minimal]


# Added to distances before their logarithm is taken, so that they do not matter below this scale,
# m.
NEAR = 0.1
# The time scale on which early sensing matters, s.
SOON = 10.0


def features(models: Names, evidence: Evidence) -> Floats:
    """The features of `models`, shape (len(models), 9), all of order one; unknown ones are 0.

    Distance to the end of f, mean and minimum distance to the path, how early it was sensed (1 at
    once, 0 never), whether it was sensed, whether it was touched, size, friction, whether it can
    move. Raises evidence.Lacking without positions or f's place.
    """
    rows = np.zeros((len(models), 9))
    rows[:, 0] = np.log(NEAR + distances_to_failure(models, evidence))
    if evidence.trajectory is not None:
        places = evidence.places(models)
        path = evidence.path()
        rows[:, 1] = np.log(NEAR + cdist(places, path).mean(axis=1))
        rows[:, 2] = np.log(NEAR + evidence.nearest(models)[:, 0])
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
