"""A hundred million samples without drift.

Drift would show as a mean that moves away from the input's, or as an output that depends on how long the filter has
run. What stays is rounding: at 1 MHz a constant comes to rest a few billionths off, and remains there.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from tega.emg import ButterworthLowpass
from tega_campaigns.stress.case import StressCase
from tega_campaigns.stress.emg import CUTOFF_HZ, FULL_SCALE, ORDER, bound_at

__all__ = ["LONG_CASES"]

PERIOD = 100_000
SETTLING_PERIODS = 5
OFFSET = 2048.0


def _period() -> NDArray[np.float64]:
    """Noise, a constant that no binary fraction is, and a slow sine; each on an offset: (PERIOD, 3)."""
    noise = np.random.default_rng(8).integers(-1000, 1001, PERIOD)
    sine = np.sin(2 * np.pi * 2 * np.arange(PERIOD) / PERIOD)
    return OFFSET + np.stack([noise, np.full(PERIOD, 0.1), sine], axis=1)


def _drift(*, quick: bool) -> list[StressCase]:
    n_samples = 1_000_000 if quick else 100_000_000
    signal = _period()
    wanted, full_scale = _sums(signal), np.abs(signal).max(axis=0)
    cases = []
    for rate_hz, name in ((1e3, "1 kHz"), (1e6, "1 MHz")):
        lowpass = ButterworthLowpass(rate_hz, CUTOFF_HZ, ORDER, channels=3)
        highest, gain, off = np.zeros(3), 0.0, 0.0
        for period in range(n_samples // PERIOD):
            out = lowpass.process(signal)
            np.maximum(highest, np.abs(out).max(axis=0), out=highest)
            if period >= SETTLING_PERIODS:
                off = float(np.abs(_sums(out) / wanted - 1).max())
                gain = max(gain, off)
        fresh = ButterworthLowpass(rate_hz, CUTOFF_HZ, ORDER, channels=3)
        for _ in range(SETTLING_PERIODS + 1):
            settled = fresh.process(signal)
        apart = float((np.abs(out - settled) / full_scale).max())
        cases.append(
            StressCase(
                group="emg",
                name=f"{n_samples:.0e} samples at {name}".replace("e+0", "e"),
                done=f"three channels (noise, a constant, a sine, all on {OFFSET:g}), repeated every {PERIOD} "
                "samples; the mean of every period against the input's, and the last period against a filter that "
                f"saw only {SETTLING_PERIODS} before it",
                happened=f"gain at 0 Hz off by at most {gain:.0e}, in the last period by {off:.0e}; the last period "
                f"{'bit for bit the same' if apart == 0 else f'differs by {apart:.0e} of full scale'}; "
                f"largest output {float((highest / full_scale).max()):.3f} of the largest input",
                error=max(apart, gain),
                bound=bound_at(rate_hz),
                error_of=FULL_SCALE,
                holds=bool((highest < 1.5 * full_scale).all()),
            )
        )
    return cases


def _sums(rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """Column sums by halves, whose rounding is far below the filter's."""
    sums: NDArray[np.float64] = np.ascontiguousarray(rows.T).sum(axis=1)
    return sums


LONG_CASES = [_drift]
"""The cases of this group, each a function of ``quick``."""
