"""The EMG filter (Eq 10) in second-order sections, and multiplied out into one fraction, where it falls apart."""

from __future__ import annotations

from decimal import Decimal
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reference.emg import farthest, rounding_bound
from reference.extremes import Extreme, short
from tega.emg import ButterworthLowpass
from tega_figures.exact import dc_gain, design, filtered, gain_squared, transfer_function

Samples = NDArray[np.float64]

CUTOFF_HZ, ORDER, N_SAMPLES = 50.0, 4, 2_000
RATES_HZ = {"1 kHz": 1e3, "10 kHz": 1e4, "100 kHz": 1e5, "1 MHz": 1e6}
FORMS = {
    name: Extreme(
        "emg",
        f"sections and fraction at {name}",
        "a step of at least 2000 samples and 0.1 s; the fraction's coefficients are rounded once, from 60 digits",
        rounding_bound(rate_hz),
        "share of full scale",
    )
    for name, rate_hz in RATES_HZ.items()
}
# From these rates on, the fraction's output is off by more than a hundredth of full scale.
FLOAT32_FAILS_HZ, FLOAT64_FAILS_HZ, USELESS = 1e4, 1e6, 0.01


@pytest.mark.slow  # 100,000 steps in 60 digits
@pytest.mark.parametrize("rate", FORMS)
def test_sections_hold_where_one_fraction_falls_apart(rate: str) -> None:
    rate_hz = RATES_HZ[rate]
    step = np.ones(max(N_SAMPLES, round(0.1 * rate_hz)))
    step[0] = 0.0
    sections = design(rate_hz, CUTOFF_HZ, ORDER)
    exact = filtered(sections, step.tolist())
    b, a = transfer_function(sections)
    wide, narrow = (farthest(as_fraction(b, a, step.tolist(), kind), exact) for kind in (float, np.float32))
    others = [f"{peer} {off(farthest(out, exact))}" for peer, out in peers(rate_hz, step).items()]
    reported = ", ".join([f"fraction in float64 {off(wide)}, in float32 {off(narrow)}", *others])
    ours = ButterworthLowpass(rate_hz, CUTOFF_HZ, ORDER, channels=1).process(step)[:, 0]
    FORMS[rate].hold(farthest(ours, exact), f"off by as much: {reported}")
    assert rate_hz < FLOAT32_FAILS_HZ or narrow > USELESS
    assert rate_hz < FLOAT64_FAILS_HZ or wide > USELESS


def as_fraction(b: list[float], a: list[float], samples: list[float], kind: Any) -> Samples:
    """Run the fraction's transposed direct form II from rest, all in one type."""
    numerator, denominator = [kind(x) for x in b], [kind(x) for x in a[1:]]
    delays = [kind(0)] * (len(denominator) + 1)
    out = []
    with np.errstate(all="ignore"):
        for sample in samples:
            x = kind(sample)
            y = numerator[0] * x + delays[0]
            for i, (bi, ai) in enumerate(zip(numerator[1:], denominator, strict=True)):
                delays[i] = bi * x + delays[i + 1] - ai * y
            out.append(float(y))
    return np.array(out)


def peers(rate_hz: float, step: Samples) -> dict[str, Samples]:
    """Return what SciPy makes of a step, in both forms."""
    signal = pytest.importorskip("scipy.signal", reason="scipy is not installed")
    b, a = signal.butter(ORDER, CUTOFF_HZ, fs=rate_hz)
    with np.errstate(all="ignore"):
        return {
            "SciPy `sosfilt`": signal.sosfilt(
                signal.butter(ORDER, CUTOFF_HZ, fs=rate_hz, output="sos"), step
            ),
            "SciPy `lfilter`": signal.lfilter(b, a, step),
        }


def off(error: float) -> str:
    return "overflow" if error == float("inf") else short(error)


def test_the_exact_response_of_a_known_filter() -> None:
    # y[n] = (x[n] + x[n-1]) / 2: gain 1 at frequency 0, cos²(π f) elsewhere; half of it at a quarter of the rate.
    mean = [[0.5, 0.5, 0.0, 1.0, 0.0, 0.0]]
    assert dc_gain(mean) == 1
    assert abs(gain_squared(mean, 0.25) - Decimal("0.5")) < Decimal("1e-55")
    for share in (1e-6, 0.125, 0.49):
        assert float(gain_squared(mean, share)) == pytest.approx(np.cos(np.pi * share) ** 2, rel=1e-12)


def test_the_exact_fraction_is_the_sections_multiplied_out() -> None:
    sections = design(1e3, 50.0, 4)
    b, a = transfer_function(sections)
    x = 0.3
    floats = [[float(c) for c in s] for s in sections]
    by_sections = np.prod([(s[0] + s[1] * x + s[2] * x * x) / (1 + s[3] * x + s[4] * x * x) for s in floats])
    assert np.polyval(b[::-1], x) / np.polyval(a[::-1], x) == pytest.approx(by_sections, rel=1e-12)
