"""The partitioning `learner`: groups models by how likely they are needed, learnt from all tests of this reduction."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from scipy.spatial.distance import cdist
from sklearn.linear_model import SGDClassifier

from ddenv.arrays import Booleans, Floats, Integers
from ddenv.reduction.chance import LEAST, MOST, beliefs, distances_to_failure, spatial_prior, undominated
from ddenv.reduction.evidence import Evidence, Names, Traits, Trial
from ddenv.reduction.partitionings import grouped

# After this number of candidates the classifier counts as much as the spatial prior.
TRUST = 10.0
# With this sum of weights, -ln(1 - probability), a group contains no needed model with probability one half.
EVEN = float(np.log(2.0))
# The grid of Platt scaling: shifts of all log odds, and slopes.
SHIFTS = np.linspace(-3.0, 3.0, 13)
SLOPES = np.array([0.5, 0.75, 1.0, 1.25])


class Learner:
    """A classifier learns from every test of this reduction what needed models look like: near the failure or the path, sensed
    early, touched, large, slippery, able to move. Its probabilities are calibrated by how often tests showed the failure, and
    combined with what the tests say about each model itself. Models of similar probability make a partition: few likely ones, or
    many unlikely ones. Before the first test it uses only the distance to the failure.

    It remembers what it has learnt: one object serves one reduction.
    """

    def __init__(self) -> None:
        self._lessons = Lessons()
        self._classifier = OnlineClassifier()

    def __call__(self, environment: Names, n_partitions: int, evidence: Evidence) -> list[Names]:
        chances = self.chances(environment, evidence)
        # By probability, the least likely first; equals in the order of the file.
        order = np.argsort(chances, kind="stable")
        weights = -np.log1p(-chances[order])
        labels = np.empty(len(environment), dtype=int)
        labels[order] = -_shares(weights, n_partitions)
        return grouped(environment, labels)

    def chances(self, environment: Names, evidence: Evidence) -> Floats:
        """The probability that each model is needed, shape (len(environment),). Learns from the tests since the last call."""
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

    def _learnt(self, rows: Floats) -> Floats:
        """How far the classifier moves the log odds of models with the features `rows` (M, F), shape (M,)."""
        return self._lessons.count / (self._lessons.count + TRUST) * _logit(self._classifier.chances(rows))


def _shares(weights: Floats, n: int) -> Integers:
    """The group of each model, 0 to n - 1; `weights` (M,) are in rising order.

    Each group but the last contains no needed model with even odds; the last gets the likeliest models. If the total weight is
    small, all groups get an equal share of it.
    """
    share = min(EVEN, float(weights.sum()) / n)
    before = np.cumsum(weights) - weights
    # A model that would exceed the share begins the next group.
    return np.minimum(np.floor(before / share + 0.5), n - 1).astype(int)


def _scaling(logits: Floats, gone: Floats, groups: Booleans) -> tuple[float, float]:
    """The slope and shift of all log odds that maximize the likelihood of the tests (Platt scaling, with a weak prior at 1 and 0).

    `gone` (G,) are the log odds of models that were not needed; of each row of `groups` (T, M) at least one model is needed.
    """
    slopes, shifts = (grid.ravel() for grid in np.meshgrid(SLOPES, SHIFTS, indexing="ij"))
    spared = -np.logaddexp(0.0, np.outer(logits, slopes) + shifts)
    some_needed = -np.expm1(groups.astype(float) @ spared)
    scores = np.log(np.clip(some_needed, LEAST, 1.0)).sum(axis=0)
    scores -= np.logaddexp(0.0, np.outer(gone, slopes) + shifts).sum(axis=0)
    scores -= 0.5 * shifts**2 + 2.0 * np.log(slopes) ** 2
    best = int(np.argmax(scores))
    return float(slopes[best]), float(shifts[best])


def _logit(chances: Floats) -> Floats:
    chances = np.clip(chances, LEAST, MOST)
    return np.log(chances) - np.log1p(-chances)


def _sigmoid(logits: Floats) -> Floats:
    return np.clip(1.0 / (1.0 + np.exp(-np.clip(logits, -30.0, 30.0))), LEAST, MOST)


Sample = tuple[Floats, Floats, Floats]


class Lessons:
    """What the tests of a reduction say about models. Each candidate is one lesson, however many models it left out.

    Removed models were not needed. Of the models that a candidate without f left out, at least one is needed. `count` is the number
    of candidates that taught something. `gone_rows` (G, F) and `gone_prior` (G,) are the features and the priors of the removed
    models.
    """

    def __init__(self) -> None:
        self.count = 0
        self.gone_rows = np.zeros((0, 0))
        self.gone_prior = np.zeros(0)
        self._taken = 0
        self._rows: dict[str, Floats] = {}
        self._prior: dict[str, float] = {}
        self._columns: dict[str, int] = {}
        # Tests that still say something: which models (T, N) of the first environment each of them left out.
        self._failed = np.zeros((0, 0), dtype=bool)
        self._new_gone = np.zeros((0, 0))
        self._new_groups: list[Names] = []

    @property
    def begun(self) -> bool:
        """Whether `take` was called yet."""
        return bool(self._columns)

    def take(self, environment: Names, rows: Floats, prior: Floats, trials: Sequence[Trial]) -> None:
        """Takes in new tests; `rows` (M, F) and `prior` (M,) are the features and priors of the current environment."""
        if not self._columns:
            self._columns = {name: column for column, name in enumerate(environment)}
            self._failed = np.zeros((0, len(environment)), dtype=bool)
        left = frozenset(environment)
        gone = [name for name in self._rows if name not in left]
        self._new_gone = np.array([self._rows.pop(name) for name in gone]).reshape(len(gone), rows.shape[1])
        self.gone_rows = np.vstack([self.gone_rows.reshape(-1, rows.shape[1]), self._new_gone])
        self.gone_prior = np.append(self.gone_prior, [self._prior.pop(name) for name in gone])
        self._rows.update(zip(environment, rows, strict=True))
        self._prior.update(zip(environment, prior.tolist(), strict=True))
        self._new_groups = self._failures(environment, trials)
        self.count += len(self._new_groups) + bool(gone)

    def _failures(self, environment: Names, trials: Sequence[Trial]) -> list[Names]:
        """The groups that new candidates without f left out of the current environment."""
        fresh, self._taken = trials[self._taken :], len(trials)
        similar = {trial.models for trial in fresh if trial.similar}
        failed = dict.fromkeys(trial.models for trial in fresh if trial.models not in similar)
        rows = [[name not in models for name in self._columns] for models in failed]
        self._failed = np.vstack([self._failed, np.array(rows, dtype=bool).reshape(-1, len(self._columns))])
        groups = (tuple(name for name in environment if name not in models) for models in failed)
        return [group for group in groups if group]

    def groups(self, environment: Names) -> Booleans:
        """Groups (T, M) of which at least one model is needed: those that candidates without f left out.

        Supersets of another group are dropped for good: they never say anything new.
        """
        groups = self._failed[:, [self._columns[name] for name in environment]]
        telling = undominated(groups)
        self._failed = self._failed[telling]
        return groups[telling]

    def fresh(self, chances: Callable[[Floats], Floats]) -> Iterator[Sample]:
        """New samples, labels and weights for a classifier: the removed models, then each candidate without f.

        The blame within a group is shared according to `chances(samples)`, the classifier's present estimate.
        """
        if len(self._new_gone):
            count = len(self._new_gone)
            yield self._new_gone, np.zeros(count, dtype=int), np.full(count, 1.0 / count)
        for group in self._new_groups:
            rows = np.array([self._rows[name] for name in group])
            needed = np.clip(chances(rows), 1e-6, 1.0 - 1e-6)
            blame = needed / needed.sum()
            labels = np.repeat([1, 0], len(group))
            yield np.vstack([rows, rows]), labels, np.append(blame, (1.0 - blame) / max(1, len(group) - 1))


# Added to distances before their logarithm is taken, so that they do not matter below this scale, m.
NEAR = 0.1
# The time scale on which early sensing matters, s.
SOON = 10.0


def features(models: Names, evidence: Evidence) -> Floats:
    """The features of `models`, shape (len(models), 9), all of order one; unknown ones are 0.

    Distance to the end of f, mean and minimum distance to the path, how early it was sensed (1 at once, 0 never), whether it was
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


def _scaled(distances: Floats) -> Floats:
    return np.log(distances + NEAR)


# Keeps the weights small while there are few tests.
REGULARIZATION = 0.01


class OnlineClassifier:
    """Logistic regression by stochastic gradient descent: the probability of label 1."""

    def __init__(self) -> None:
        self._model: SGDClassifier | None = None
        self._mean = self._spread = np.zeros(0)

    def see(self, samples: Floats) -> None:
        """Sets the scale of each feature from `samples` (N, F). Call it before learning, with all samples there will ever be."""
        spread = samples.std(axis=0)
        self._mean, self._spread = samples.mean(axis=0), np.where(spread > 1e-9, spread, 1.0)

    def learn(self, samples: Floats, labels: Floats, weights: Floats, seed: int) -> None:
        """Learns in one step from `samples` (N, F) with `labels` (N,), 0 or 1, and `weights` (N,)."""
        if self._model is None:
            self._model = SGDClassifier(loss="log_loss", alpha=REGULARIZATION, average=True, random_state=seed)
        with warnings.catch_warnings():
            # Early on there may be one label only, about which scikit-learn warns.
            warnings.simplefilter("ignore")
            self._model.partial_fit(self._scaled(samples), labels, classes=[0, 1], sample_weight=weights)

    def chances(self, samples: Floats) -> Floats:
        """The probability of label 1 for each of `samples` (N, F), shape (N,); one half before anything is learnt."""
        if self._model is None or not len(samples):
            return np.full(len(samples), 0.5)
        return np.asarray(self._model.predict_proba(self._scaled(samples))[:, 1])

    def _scaled(self, samples: Floats) -> Floats:
        return (samples - self._mean) / self._spread
