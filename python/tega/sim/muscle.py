"""Synthetic surface EMG: effort to three channels of raw signal.

Simulated. Amplitude follows effort, the spectrum is that of a forearm electrode (20 to 450 Hz at 1 kHz, limited by
the sample rate), channels share some signal, and each sits on its own electrode offset. Fatigue, motion artefacts and
mains are not modelled.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["emg_from_effort"]

# Share of full effort that each muscle shows (two flexors and an extensor), and how much its neighbours leak in.
GAIN_UV = (420.0, 350.0, 380.0)
OFFSET_UV = (12.0, -8.0, 5.0)
CROSSTALK = 0.15
REST_UV = 6.0


def emg_from_effort(effort: ArrayLike, *, seed: int) -> NDArray[np.float64]:
    """Return raw EMG for a course of effort.

    Args:
        effort: Share of the strongest contraction per sample, 0 to 1, shape (n,).
        seed: Seed of the noise; the same seed gives the same signal.

    Returns:
        Microvolts, float64 (n, 3).
    """
    effort = np.clip(np.asarray(effort, np.float64), 0.0, 1.0)
    rng = np.random.default_rng(seed)
    white = rng.standard_normal((effort.size + 4, 3))
    # Differencing removes the slow part, averaging three the fastest: a band like that of the skin's signal.
    band = np.diff(white, axis=0)
    band = (band[:-2] + band[1:-1] + band[2:])[: effort.size] / np.sqrt(2.0)
    band = (1 - CROSSTALK) * band + CROSSTALK * np.roll(band, 1, axis=1)
    signal: NDArray[np.float64] = band * (REST_UV + effort[:, None] * np.array(GAIN_UV)) + np.array(OFFSET_UV)
    return signal
