"""Name the stimulus that a percept is most like. No person names better than the percepts allow; people name worse."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Array = NDArray[np.float64]


class Discriminant:
    """Linear discriminant with one covariance, shrunk a little towards its diagonal.

    ``percepts`` is (trials, features), ``stimuli`` the number of each trial's stimulus, int (trials,).
    """

    def __init__(self, percepts: Array, stimuli: NDArray[np.int64]) -> None:
        self.kinds = np.unique(stimuli)
        self.means = np.array([percepts[stimuli == kind].mean(axis=0) for kind in self.kinds])
        rest = percepts - self.means[np.searchsorted(self.kinds, stimuli)]
        covariance = rest.T @ rest / max(len(rest) - len(self.kinds), 1)
        shrunk = 0.95 * covariance + 0.05 * np.diag(np.diag(covariance)) + 1e-6 * np.eye(len(covariance))
        self.inverse = np.linalg.inv(shrunk)

    def named(self, percepts: Array) -> NDArray[np.int64]:
        """Return the stimulus that each percept is most like."""
        weights = self.means @ self.inverse
        scores = percepts @ weights.T - 0.5 * (weights * self.means).sum(axis=1)
        named: NDArray[np.int64] = self.kinds[np.argmax(scores, axis=1)]
        return named

    def along(self, percepts: Array) -> Array:
        """Return how far percepts lie from the first of two stimuli towards the second."""
        far: Array = percepts @ (self.inverse @ (self.means[1] - self.means[0]))
        return far
