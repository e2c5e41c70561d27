"""Compute the figures of a dataset that a training run normalises with."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tega.runtime.opencv import load_cv2

QUANTILES = (0.01, 0.10, 0.50, 0.90, 0.99)

Figures = dict[str, Any]


def figures(values: NDArray[Any]) -> Figures:
    """Return minimum, maximum, mean, standard deviation, count and quantiles over the first axis, frames."""
    shape = values.shape[1:] or (1,)
    rows = values.reshape(len(values), -1)
    # One column after the other: all of a long recording as double precision would be its largest array by far.
    known = [_known(rows[:, k].astype(np.float64)) for k in range(rows.shape[1])]
    found = {name: np.reshape([one[name] for one in known], shape).tolist() for name in known[0]}
    return found | {"count": [len(rows)]}


def _known(column: NDArray[np.float64]) -> dict[str, float]:
    quantiles = np.quantile(column, QUANTILES)
    return {"min": column.min(), "max": column.max(), "mean": column.mean(), "std": column.std()} | {
        _key(q): value for q, value in zip(QUANTILES, quantiles, strict=True)
    }


def _key(quantile: float) -> str:
    return f"q{round(quantile * 100):02d}"


class Colours:
    """Counts of every value of red, green and blue over pictures, from which their figures follow exactly."""

    def __init__(self) -> None:
        self._counts = np.zeros((3, 256), np.int64)
        self._n = 0

    def add(self, image: NDArray[np.uint8], n_times: int) -> None:
        """Count a picture, uint8 (H, W, 3) in BGR, so many times."""
        cv2 = load_cv2("export")
        for colour, channel in enumerate((2, 1, 0)):
            counts = cv2.calcHist([image], [channel], None, [256], [0, 256]).ravel()
            self._counts[colour] += n_times * counts.astype(np.int64)
        self._n += n_times

    def __iadd__(self, other: Colours) -> Colours:
        """Count those of another one too."""
        self._counts += other._counts
        self._n += other._n
        return self

    def figures(self) -> Figures:
        """Return the figures per colour of values from 0 to 1, each of shape (3, 1, 1)."""
        levels = np.arange(256) / 255.0
        share = self._counts / self._counts.sum(1, keepdims=True)
        mean = share @ levels
        known: Figures = {
            "min": [levels[np.flatnonzero(row)[0]] for row in self._counts],
            "max": [levels[np.flatnonzero(row)[-1]] for row in self._counts],
            "mean": mean,
            "std": np.sqrt(np.maximum(share @ levels**2 - mean**2, 0.0)),
        }
        below = np.cumsum(share, axis=1)
        known |= {_key(q): [levels[np.searchsorted(row, q - 1e-12)] for row in below] for q in QUANTILES}
        shaped = {name: np.reshape(value, (3, 1, 1)).tolist() for name, value in known.items()}
        return shaped | {"count": [self._n]}
