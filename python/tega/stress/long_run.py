"""A hundred million samples without drift."""

from __future__ import annotations

from math import fsum

import numpy as np
from numpy.typing import NDArray

from tega.emg import ButterworthLowpass
from tega.stress.case import StressCase
from tega.stress.emg import CUTOFF_HZ, ORDER, bound_at

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
    periods = n_samples // PERIOD
    signal = _period()
    full_scale = np.abs(signal).max(axis=0)
    cases = []
    for rate_hz, name in ((1e3, "1 kHz"), (1e6, "1 MHz")):
        lowpass = ButterworthLowpass(rate_hz, CUTOFF_HZ, ORDER, channels=3)
        highest = np.zeros(3)
        for _ in range(periods):
            out = lowpass.process(signal)
            np.maximum(highest, np.abs(out).max(axis=0), out=highest)
        fresh = ButterworthLowpass(rate_hz, CUTOFF_HZ, ORDER, channels=3)
        for _ in range(SETTLING_PERIODS):
            settled = fresh.process(signal)
        apart = float((np.abs(out - settled) / full_scale).max())
        gains = [fsum(out[:, c]) / fsum(signal[:, c]) - 1 for c in range(3)]
        gain = max(map(abs, gains))
        cases.append(
            StressCase(
                group="emg",
                name=f"{n_samples:.0e} samples at {name}".replace("e+0", "e"),
                done=f"three channels (noise, a constant, a sine, all on {OFFSET:g}), repeated every {PERIOD} samples; "
                f"the last {PERIOD} against a filter that saw only {SETTLING_PERIODS * PERIOD}, and their mean "
                "against the input's",
                happened=f"{'bit for bit the same' if apart == 0 else f'apart by {apart:.0e} of full scale'}, "
                f"gain at 0 Hz off by {gain:.0e}; "
                f"largest output {float((highest / full_scale).max()):.3f} of the largest input",
                error=max(apart, gain),
                bound=bound_at(rate_hz),
                error_of="share of full scale",
                holds=bool((highest < 1.5 * full_scale).all()),
            )
        )
    return cases


LONG_CASES = [_drift]
"""The cases of this group, each a function of ``quick``."""
