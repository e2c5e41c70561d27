"""Compute the time of each sample of a recording, on the clock that the commands are stamped with.

Sounds of known time, clicks, are found in the recording: the input's latency drops out. What is left is how well the
times of the clicks are known: :data:`CLICKS_MS`.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import InvalidValueError

CLICKS_MS: Final = {"keys": 20.0, "speaker": 8.0}
"""Uncertainty of a click's time, ms. A keyboard reports a key up to that long after its sound; a speaker's stamp
lacks its converter's delay, and sound takes 3 ms a metre."""

_CLICK_HZ = 2000.0
_WIDTH_S = 0.002
_APART_S = 0.08
_FITS_S = 0.03
_FEWEST_CLICKS = 3


class ClockMap(msgspec.Struct, frozen=True, kw_only=True):
    """Time of each sample: sample n was recorded at ``began_s + n / rate_hz``, by that clock.

    ``uncertainty_ms`` is how far it may be off; ``how`` is ``clicks``, in logs of before version 0.3 also
    ``stamps`` or ``arrival``.
    """

    began_s: float
    rate_hz: float
    uncertainty_ms: float
    how: str


def _line(index: NDArray[np.float64], at_s: NDArray[np.float64], rate_hz: float) -> tuple[float, float]:
    """Fit time of sample 0 and rate; over a short time the rate is taken as it was asked for."""
    if (index[-1] - index[0]) / rate_hz < 10:
        return float(np.median(at_s - index / rate_hz)), rate_hz
    seconds_each, began_s = np.polyfit(index, at_s, 1)
    # A sound card is right to a thousandth; a fit that says more is a fit of the jitter.
    if abs(seconds_each * rate_hz - 1) > 1e-3:
        return float(np.median(at_s - index / rate_hz)), rate_hz
    return float(began_s), float(1 / seconds_each)


def find_clicks(samples: NDArray[np.float64], rate_hz: float) -> NDArray[np.float64]:
    """Return the times of short, hard sounds in ``samples``, seconds from the first, float64 (n_clicks,).

    A click is a peak of the signal above 2 kHz, ten times the middle level and a fifth of the loudest; its
    time is the rise through half of its peak. ``samples`` is float64 (n,). The rate must be high enough to
    separate a click from a motor.
    """
    from tega_bench.vest_latency.detect import load_signal

    signal: Any = load_signal()
    if rate_hz < 3 * _CLICK_HZ:
        raise InvalidValueError(
            f"sound: {rate_hz:g} samples/s are too few to find clicks", "record with 16000 or more"
        )
    sos = signal.butter(4, _CLICK_HZ, "highpass", fs=rate_hz, output="sos")
    width = max(3, round(_WIDTH_S * rate_hz))
    power = np.convolve(signal.sosfiltfilt(sos, samples) ** 2, np.ones(width) / width, "same")
    level = np.sqrt(np.maximum(power, 0.0))
    height = max(10 * float(np.median(level)), 0.2 * float(level.max(initial=0.0)), 1e-6)
    peaks, _ = signal.find_peaks(level, height=height, distance=max(1, round(_APART_S * rate_hz)))
    found = []
    for peak in peaks:
        start = max(0, peak - 5 * width)
        before = np.flatnonzero(level[start:peak] < level[peak] / 2)
        found.append((start + before[-1] + 1 if len(before) else peak) / rate_hz)
    return np.array(found)


def by_clicks(
    samples: NDArray[np.float64], rate_hz: float, clicks_s: Sequence[float], *, source: str
) -> ClockMap:
    """Map by clicks with known times, in a recording that began at any time.

    ``samples`` is float64 (n,), ``rate_hz`` as the recording has it. ``clicks_s`` is when there were clicks:
    three or more, not evenly spaced; ``source`` is what made them: a key of :data:`CLICKS_MS`.
    ``InvalidValueError`` if they are too few, or not found in the recording.
    """
    known = np.sort(np.asarray(clicks_s, np.float64))
    if len(known) < _FEWEST_CLICKS:
        raise InvalidValueError(
            f"{len(known)} clicks are in the log, {_FEWEST_CLICKS} or more are needed", "record again"
        )
    found = find_clicks(samples, rate_hz)
    best = np.empty((0, 2))
    for began_s in np.subtract.outer(known, found).ravel():
        gaps = np.abs(np.subtract.outer(known, found + began_s))
        nearest = gaps.argmin(axis=1)
        fits = gaps[np.arange(len(known)), nearest] < _FITS_S
        if fits.sum() > len(best):
            best = np.stack([known[fits], found[nearest[fits]]], axis=1)
    if len(best) < max(_FEWEST_CLICKS, 0.6 * len(known)):
        raise InvalidValueError(
            f"{len(best)} of the log's {len(known)} clicks are in the recording ({len(found)} sharp sounds in all)",
            "click closer to the microphone; is it the recording of this log?",
        )
    began_s, true_hz = _line(best[:, 1] * rate_hz, best[:, 0], rate_hz)
    off = best[:, 0] - (began_s + best[:, 1] * rate_hz / true_hz)
    uncertainty_ms = CLICKS_MS.get(source, 20.0) + 1e3 * float(np.abs(off).max())
    return ClockMap(began_s=began_s, rate_hz=true_hz, uncertainty_ms=uncertainty_ms, how="clicks")
