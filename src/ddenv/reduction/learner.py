"""Partitions by how likely models are needed, learnt from the tests of this run."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator, Sequence

import numpy as np
from scipy.spatial.distance import cdist
from sklearn.linear_model import SGDClassifier

from ddenv.reduction.chance import LEAST, MOST, beliefs, distances_to_failure, spatial_prior, undominated
from ddenv.reduction.evidence import Evidence, Partition, Traits, Trial
from ddenv.reduction.partitionings import grouped

# Keeps weights small while there are few tests.
REGULARIZATION = 0.01


class OnlineClassifier:
    """Logistic regression by stochastic gradient descent; the chance of a label 1."""

    def __init__(self) -> None:
        self._model: SGDClassifier | None = None
        self._mean = self._spread = np.zeros(0)

    def see(self, samples: np.ndarray) -> None:
        """All there will be, shape (N, F), before anything is learnt: what is usual of each feature."""
        spread = samples.std(axis=0)
        self._mean, self._spread = samples.mean(axis=0), np.where(spread > 1e-9, spread, 1.0)

    def learn(self, samples: np.ndarray, labels: np.ndarray, weights: np.ndarray, seed: int) -> None:
        """One step: `samples` (N, F) with `labels` (N,) of 0 and 1 that count `weights` (N,)."""
        if self._model is None:
            self._model = SGDClassifier(loss="log_loss", alpha=REGULARIZATION, average=True, random_state=seed)
        with warnings.catch_warnings():
            # Early on there may be one label only.
            warnings.simplefilter("ignore")
            self._model.partial_fit(self._scaled(samples), labels, classes=[0, 1], sample_weight=weights)

    def chances(self, samples: np.ndarray) -> np.ndarray:
        """The chance of label 1 for each of `samples` (N, F), shape (N,); one half before anything is learnt."""
        if self._model is None or not len(samples):
            return np.full(len(samples), 0.5)
        return self._model.predict_proba(self._scaled(samples))[:, 1]

    def _scaled(self, samples: np.ndarray) -> np.ndarray:
        return (samples - self._mean) / self._spread


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


Sample = tuple[np.ndarray, np.ndarray, np.ndarray]


class Lessons:
    """The tests of a reduction, as what they say of models. Each candidate is one lesson, however many models it left out.

    Models that were removed were not needed; of those that a candidate without f left out, one is needed. `count` is the number
    of candidates that told something. `gone_rows` (G, F) and `gone_prior` (G,) are the features and the first chances of what
    was removed.
    """

    def __init__(self) -> None:
        self.count = 0
        self.gone_rows = np.zeros((0, 0))
        self.gone_prior = np.zeros(0)
        self._taken = 0
        self._rows: dict[str, np.ndarray] = {}
        self._prior: dict[str, float] = {}
        self._columns: dict[str, int] = {}
        # Those that are left to say something: of each (T, N) whether a model of the first environment was left out.
        self._failed = np.zeros((0, 0), dtype=bool)
        self._new_gone = np.zeros((0, 0))
        self._new_groups: list[Partition] = []

    @property
    def begun(self) -> bool:
        """Whether the first environment was seen."""
        return bool(self._columns)

    def take(self, environment: Partition, rows: np.ndarray, prior: np.ndarray, trials: Sequence[Trial]) -> None:
        """What was tested since the last time; `rows` (M, F) and `prior` (M,) are of the environment as it is now."""
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

    def _failures(self, environment: Partition, trials: Sequence[Trial]) -> list[Partition]:
        """What new candidates without f had left out of the environment as it is now."""
        fresh, self._taken = trials[self._taken :], len(trials)
        similar = {trial.models for trial in fresh if trial.similar}
        failed = dict.fromkeys(trial.models for trial in fresh if trial.models not in similar)
        rows = [[name not in models for name in self._columns] for models in failed]
        self._failed = np.vstack([self._failed, np.array(rows, dtype=bool).reshape(-1, len(self._columns))])
        groups = (tuple(name for name in environment if name not in models) for models in failed)
        return [group for group in groups if group]

    def groups(self, environment: Partition) -> np.ndarray:
        """Of each row (T, M) at least one model is needed: those that a candidate without f had left out.

        A group that holds all of another says nothing more, and never will.
        """
        groups = self._failed[:, [self._columns[name] for name in environment]]
        telling = undominated(groups)
        self._failed = self._failed[telling]
        return groups[telling]

    def fresh(self, chances: Callable[[np.ndarray], np.ndarray]) -> Iterator[Sample]:
        """New lessons for a classifier as samples, labels and weights: removed models, then each candidate without f.

        Who of a group is to blame is shared out by what the classifier now thinks, `chances(samples)`.
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
