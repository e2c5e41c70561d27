"""EMG low-pass variants: ours, SciPy's two forms, Numba's loop, and the truth to 60 digits."""

from __future__ import annotations

from collections.abc import Callable
from decimal import Decimal
from importlib.util import find_spec

import numpy as np
from numpy.typing import NDArray

from tega.emg import ButterworthLowpass
from tega_figures.exact import design, filtered

__all__ = ["BLOCK_ROWS", "CHANNELS", "Filter", "error_of_full_scale", "filters", "signal", "true_response"]

# 1 kHz, 50 Hz, 4th order, three channels: the chain of Eq 10. Ten samples are what comes in 10 ms.
RATE_HZ, CUTOFF_HZ, ORDER, CHANNELS = 1000.0, 50.0, 4, 3
BLOCK_ROWS = 10

Samples = NDArray[np.float64]
Filter = Callable[[Samples], Samples]
"""Takes the next samples, (n, channels), and keeps its state."""


def signal(n_rows: int, *, seed: int = 3) -> Samples:
    """Return bursts of noise on an offset, as a 12-bit converter gives them, float64 (n, 3)."""
    rng = np.random.default_rng(seed)
    swell = 0.1 + np.abs(np.sin(np.arange(n_rows) / 400))[:, np.newaxis]
    return np.clip(np.rint(2048 + 400 * swell * rng.standard_normal((n_rows, CHANNELS))), 0, 4095)


def filters(first: Samples) -> dict[str, Filter]:
    """Return, ours first, every filter that can be made with what is installed.

    Each is settled on ``first``, the first row of the samples, (channels,).
    """
    made: dict[str, Filter] = {"TEGA": ButterworthLowpass(RATE_HZ, CUTOFF_HZ, ORDER, first.size).process}
    if find_spec("scipy") is not None:
        made |= _scipy(first)
        if find_spec("numba") is not None:
            made["Numba, second-order sections"] = _numba(first)
    return made


def _scipy(first: Samples) -> dict[str, Filter]:
    from scipy.signal import butter, lfilter, lfilter_zi, sosfilt, sosfilt_zi

    sos = butter(ORDER, CUTOFF_HZ, fs=RATE_HZ, output="sos")
    b, a = butter(ORDER, CUTOFF_HZ, fs=RATE_HZ)
    sos_state = sosfilt_zi(sos)[:, :, np.newaxis] * first
    ba_state = lfilter_zi(b, a)[:, np.newaxis] * first

    def by_sections(samples: Samples) -> Samples:
        nonlocal sos_state
        out: Samples
        out, sos_state = sosfilt(sos, samples, axis=0, zi=sos_state)
        return out

    def by_transfer_function(samples: Samples) -> Samples:
        nonlocal ba_state
        out: Samples
        out, ba_state = lfilter(b, a, samples, axis=0, zi=ba_state)
        return out

    return {"SciPy sosfilt": by_sections, "SciPy lfilter (b, a)": by_transfer_function}


def _numba(first: Samples) -> Filter:
    from scipy.signal import butter, sosfilt_zi

    from tega_figures.bench.compiled import filter_loop

    sos = butter(ORDER, CUTOFF_HZ, fs=RATE_HZ, output="sos")
    state = np.ascontiguousarray(sosfilt_zi(sos)[:, :, np.newaxis] * first)
    run = filter_loop()

    def compiled(samples: Samples) -> Samples:
        out = np.empty_like(samples)
        run(sos, state, samples, out)
        return out

    return compiled


def true_response(samples: Samples) -> list[list[Decimal]]:
    """Return the exact output for a short signal, (n, channels), one list a channel."""
    sections = design(RATE_HZ, CUTOFF_HZ, ORDER)
    return [filtered(sections, channel) for channel in samples.T.tolist()]


def error_of_full_scale(own: Samples, truth: list[list[Decimal]], full_scale: float) -> float:
    """Return the largest deviation over the signal's full scale."""
    pairs = (
        pair
        for got, exact in zip(own.T.tolist(), truth, strict=True)
        for pair in zip(got, exact, strict=True)
    )
    return max(float(abs(Decimal(got) - exact)) for got, exact in pairs) / full_scale
