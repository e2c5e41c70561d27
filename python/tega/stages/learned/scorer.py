"""Turn a block of EMG features into the values and the effort of a learned decoder."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tega.stages.learned.features import AMPLITUDES, block_features
from tega.stages.learned.model import Model


class BlockScorer:
    """Turns a block's features into smoothed, scaled values and an effort; keeps the smoothing's state.

    ``newest`` are the last block's features: the smoothed ones' limit if the muscles stayed the same.
    """

    def __init__(self, model: Model) -> None:
        n, channels = 0, len(model.channels)
        spans = []
        for name in model.features:
            width = channels * (4 if name == "AR" else 1)
            if name in AMPLITUDES:
                spans.append(slice(n, n + width))
            n += width
        self._amplitude = np.zeros(n, bool)
        for span in spans:
            self._amplitude[span] = True
        self._floor = np.array(model.floor)
        self._gains = -np.expm1(-model.tau / model.rate_hz / np.array(model.smoothing_s))[:, np.newaxis]
        self._state: NDArray[np.float64] | None = None
        self.newest: NDArray[np.float64] = np.empty(0)
        self.use(model)

    def use(self, model: Model) -> None:
        """Go on with another model of the same features."""
        self._features, self._bias, self._gamma = model.features, model.bias, model.gamma
        self._mean, self._scale = np.array(model.mean), np.array(model.scale)
        self._weights, self._support = np.array(model.weights), np.array(model.support)

    def smooth(self, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the smoothed features of the next block, as the model was trained on them."""
        values = block_features(samples, self._features)
        if len(self._floor):
            values[self._amplitude] = np.log(values[self._amplitude] + self._floor)
        if self._state is None:
            self._state = np.repeat(values[np.newaxis], len(self._gains), axis=0)
        else:
            self._state = self._state + self._gains * (values - self._state)
        self.newest = np.tile(values, len(self._gains))
        return self._state.ravel()

    def scaled(self, smoothed: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return them in standard deviations."""
        z: NDArray[np.float64] = (smoothed - self._mean) / self._scale
        return z

    def effort(self, z: NDArray[np.float64]) -> float:
        """Return the effort. Sums instead of products of matrices: those may differ from machine to machine."""
        if self._gamma:
            apart = self._support - z
            z = np.exp(-self._gamma * np.add.reduce(apart * apart, axis=1))
        return float(np.add.reduce(self._weights * z)) + self._bias
