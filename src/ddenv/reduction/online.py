"""A classifier that learns as tests come in."""

from __future__ import annotations

import warnings

import numpy as np
from sklearn.linear_model import SGDClassifier

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
