"""Estimate the information that percepts carry of their stimuli, in bits, and difference thresholds.

A linear discriminant is fitted to one half of the trials and names the stimulus of the other half, and the halves
change places; the mutual information of stimulus and name, with Grassberger's entropies, is a lower bound of what the
percepts carry. No person names better than the percepts allow; people name worse.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    Array = NDArray[np.float64]


class Discriminant:
    """Linear discriminant with one covariance, shrunk a little towards its diagonal.

    Args:
        percepts: (trials, features).
        stimuli: Number of each trial's stimulus, int (trials,).
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


def information_bits(percepts: Array, stimuli: NDArray[np.int64], rng: np.random.Generator) -> float:
    """Return the bits of a presentation that percepts carry of their stimuli, never below 0 by more than its noise."""
    order = rng.permutation(len(stimuli))
    halves = order[: len(order) // 2], order[len(order) // 2 :]
    named = np.empty_like(stimuli)
    for learn, test in (halves, halves[::-1]):
        named[test] = Discriminant(percepts[learn], stimuli[learn]).named(percepts[test])
    return confusion_bits(stimuli, named)


def confusion_bits(stimuli: NDArray[np.int64], named: NDArray[np.int64]) -> float:
    """Return the mutual information of two columns of numbers, bits."""
    n = len(stimuli)
    joint = np.zeros((stimuli.max() + 1, named.max() + 1))
    np.add.at(joint, (stimuli, named), 1)
    parts = (joint.ravel(), joint.sum(axis=0), joint.sum(axis=1))
    entropies = [_entropy_bits(part.astype(np.int64), n) for part in parts]
    return entropies[1] + entropies[2] - entropies[0]


def _entropy_bits(counts: NDArray[np.int64], n: int) -> float:
    """Return the entropy of a table, bits, hardly biased where its cells hold few (Grassberger 2003, physics/0307138).

    ``H = ln N - sum(n_i G(n_i)) / N`` with G(1) = -gamma - ln 2, G(2) = 2 + G(1), G(2k + 1) = G(2k) and
    G(2k + 2) = G(2k) + 2 / (2k + 1).
    """
    most = int(counts.max())
    even = np.cumsum(2 / (2 * np.arange(most // 2 + 1) + 1.0)) - np.euler_gamma - np.log(2)
    k = np.arange(1, most + 1)
    g = np.where(k >= 2, even[np.maximum(k // 2 - 1, 0)], -np.euler_gamma - np.log(2))
    some = counts[counts > 0]
    return float((np.log(n) - (some * g[some - 1]).sum() / n) / np.log(2))


def share_told(lower: Array, higher: Array, rng: np.random.Generator) -> float:
    """Return how often the higher of a pair of presentations is told, 0.5 to 1 for an observer who guesses or knows."""
    n = min(len(lower), len(higher)) // 2
    stimuli = np.repeat([0, 1], n)
    judge = Discriminant(np.concatenate([lower[:n], higher[:n]]), stimuli)
    below, above = judge.along(lower[n : 2 * n]), judge.along(higher[n : 2 * n])
    ties = rng.random(n) < 0.5
    return float(((above > below) | ((above == below) & ties)).mean())


def threshold_at(differences: Sequence[float], reported: Sequence[float], share: float = 0.75) -> float:
    """Return the difference that is told in three of four pairs; infinite where none is."""
    differences, reported = [0.0, *differences], [0.5, *np.maximum.accumulate(reported).tolist()]
    for n in range(1, len(reported)):
        if reported[n] >= share:
            part = (share - reported[n - 1]) / (reported[n] - reported[n - 1])
            return float(differences[n - 1] + part * (differences[n] - differences[n - 1]))
    return float("inf")
