"""What tests teach about single models."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

import numpy as np

from ddenv.reduction.chance import undominated
from ddenv.reduction.evidence import Partition, Trial

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
