"""The same filter multiplied out into one fraction, which is where it falls apart."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from tega.emg import ButterworthLowpass
from tega_campaigns.stress.case import StressCase, short
from tega_campaigns.stress.emg import CUTOFF_HZ, FULL_SCALE, ORDER, bound_at, worst_error
from tega_campaigns.stress.exact_emg import design, filtered, transfer_function

__all__ = ["FORM_CASES"]

STEP_S, FEWEST_SAMPLES = 0.1, 2_000
# From these rates on, the fraction's output is off by more than a hundredth of full scale.
FLOAT32_FAILS_HZ, FLOAT64_FAILS_HZ = 1e4, 1e6
USELESS = 0.01


def _run(b: list[float], a: list[float], samples: list[float], dtype: Any) -> NDArray[np.float64]:
    """The fraction's transposed direct form II from rest, all in one type."""
    numerator, denominator = [dtype(x) for x in b], [dtype(x) for x in a[1:]]
    delays = [dtype(0)] * (len(denominator) + 1)
    out = []
    with np.errstate(all="ignore"):
        for sample in samples:
            x = dtype(sample)
            y = numerator[0] * x + delays[0]
            for i, (bi, ai) in enumerate(zip(numerator[1:], denominator, strict=True)):
                delays[i] = bi * x + delays[i + 1] - ai * y
            out.append(float(y))
    return np.array(out)


def _peers(rate_hz: float, step: NDArray[np.float64]) -> dict[str, NDArray[np.float64]]:
    try:
        from scipy.signal import butter, lfilter, sosfilt
    except ImportError:
        return {}
    b, a = butter(ORDER, CUTOFF_HZ, fs=rate_hz)
    with np.errstate(all="ignore"):
        return {
            "SciPy `sosfilt`": sosfilt(butter(ORDER, CUTOFF_HZ, fs=rate_hz, output="sos"), step),
            "SciPy `lfilter`": lfilter(b, a, step),
        }


def _forms(*, quick: bool) -> list[StressCase]:  # noqa: ARG001  # every case is called alike
    cases = []
    for rate_hz, name in ((1e3, "1 kHz"), (1e4, "10 kHz"), (1e5, "100 kHz"), (1e6, "1 MHz")):
        step = np.ones(max(FEWEST_SAMPLES, round(STEP_S * rate_hz)))
        step[0] = 0.0
        sections = design(rate_hz, CUTOFF_HZ, ORDER)
        exact = filtered(sections, step.tolist())
        ours = worst_error(
            ButterworthLowpass(rate_hz, CUTOFF_HZ, ORDER, channels=1).process(step)[:, 0], exact
        )
        b, a = transfer_function(sections)
        wide = worst_error(_run(b, a, step.tolist(), float), exact)
        narrow = worst_error(_run(b, a, step.tolist(), np.float32), exact)
        others = [f"{peer} {_off(worst_error(out, exact))}" for peer, out in _peers(rate_hz, step).items()]
        cases.append(
            StressCase(
                group="emg",
                name=f"sections and fraction at {name}",
                done=f"a step of {len(step)} samples; the fraction's coefficients are rounded once, from 60 digits",
                happened="off by: "
                + ", ".join(
                    [
                        f"sections {_off(ours)}",
                        f"fraction in float64 {_off(wide)}, in float32 {_off(narrow)}",
                        *others,
                    ]
                ),
                error=ours,
                bound=bound_at(rate_hz),
                error_of=FULL_SCALE,
                holds=(rate_hz < FLOAT32_FAILS_HZ or narrow > USELESS)
                and (rate_hz < FLOAT64_FAILS_HZ or wide > USELESS),
            )
        )
    return cases


def _off(error: float) -> str:
    return "overflow" if error == float("inf") else short(error)


FORM_CASES = [_forms]
"""The cases of this group, each a function of ``quick``."""
