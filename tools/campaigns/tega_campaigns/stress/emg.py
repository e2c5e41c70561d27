"""The EMG filter at the ends of rates, cutoffs and numbers."""

from __future__ import annotations

import time
from collections.abc import Callable
from decimal import Decimal

import numpy as np
from numpy.typing import NDArray

from tega.emg import ButterworthLowpass
from tega.errors import InvalidValueError
from tega_campaigns.stress.case import StressCase
from tega_campaigns.stress.exact_emg import dc_gain, design, filtered, gain_squared

__all__ = ["CUTOFF_HZ", "EMG_CASES", "FULL_SCALE", "ORDER", "bound_at", "worst_error"]

Samples = NDArray[np.float64]

CUTOFF_HZ = 50.0
ORDER = 4
RATES_HZ = (200.0, 1e3, 1e4, 1e5, 1e6)
N_SAMPLES = 2_000
FULL_SCALE = "share of full scale"


def worst_error(got: Samples, exact: list[Decimal]) -> float:
    """Return the largest distance; infinite if a number is not finite."""
    if not np.isfinite(got).all():
        return float("inf")
    return max(float(abs(Decimal(g) - e)) for g, e in zip(got.tolist(), exact, strict=True))


def bound_at(rate_hz: float) -> float:
    """Return the error that passes: poles crowd towards 1 with the rate, rounding grows as its square."""
    return 1e-14 + 5e-21 * rate_hz**2


def _signals() -> dict[str, Samples]:
    impulse, step = np.zeros(N_SAMPLES), np.ones(N_SAMPLES)
    impulse[1], step[0] = 1.0, 0.0
    return {"impulse": impulse, "step": step}


def _impulse_and_step(*, quick: bool) -> list[StressCase]:  # noqa: ARG001  # every case is called alike
    cases = []
    for name, signal in _signals().items():
        errors, last, peak = [], [], []
        for order in range(1, 9):
            lowpass = ButterworthLowpass(1e3, CUTOFF_HZ, order, channels=1)
            got = lowpass.process(signal)[:, 0]
            errors.append(worst_error(got, filtered(design(1e3, CUTOFF_HZ, order), signal.tolist())))
            last.append(abs(float(got[-1]) - signal[-1]))
            peak.append(float(got.max()))
        cases.append(
            StressCase(
                group="emg",
                name=name,
                done=f"orders 1 to 8, 50 Hz at 1 kHz, {N_SAMPLES} samples",
                happened=f"highest output {max(peak):.3f}; after {N_SAMPLES} samples the output stays "
                f"at {signal[-1]:g} within {max(last):.0e}",
                error=max(errors),
                bound=1e-14,
                error_of=FULL_SCALE,
            )
        )
    return cases


def _sample_rates(*, quick: bool) -> list[StressCase]:  # noqa: ARG001
    noise = np.random.default_rng(4).integers(-1000, 1001, N_SAMPLES) / 1000.0
    cases = []
    for rate_hz in RATES_HZ:
        errors = []
        for offset in (0.0, 1.0):
            signal = noise + offset
            got = ButterworthLowpass(rate_hz, CUTOFF_HZ, ORDER, channels=1).process(signal)[:, 0]
            exact = filtered(design(rate_hz, CUTOFF_HZ, ORDER), signal.tolist())
            errors.append(worst_error(got, exact) / (1 + offset))
        cases.append(
            StressCase(
                group="emg",
                name=f"{_hz(rate_hz)} sampling",
                done=f"4th order, 50 Hz, {N_SAMPLES} samples of noise, with an offset and without",
                happened="follows the filter designed and run in 60 digits",
                error=max(errors),
                bound=bound_at(rate_hz),
                error_of=FULL_SCALE,
            )
        )
    return cases


def _hz(value: float) -> str:
    return (
        f"{value / 1e6:g} MHz"
        if value >= 1e6
        else f"{value / 1e3:g} kHz"
        if value >= 1e3
        else f"{value:g} Hz"
    )


def _cutoffs(*, quick: bool) -> list[StressCase]:  # noqa: ARG001
    rng = np.random.default_rng(5)
    noise = rng.uniform(-1, 1, 20_000)
    cases = []
    for name, shares in {
        "cutoff near 0": (1e-6, 1e-5, 1e-3),
        "cutoff near half the rate": (0.5 - 1e-6, 0.5 - 1e-5, 0.499),
    }.items():
        gains, corners, peaks = [], [], []
        for share in shares:
            for order in range(1, 9):
                lowpass = ButterworthLowpass(1.0, share, order, channels=1)
                sos = lowpass.sos.tolist()
                gains.append(float(abs(dc_gain(sos) - 1)))
                corners.append(float(abs(2 * gain_squared(sos, share) - 1)))
                peaks.append(float(np.abs(lowpass.process(noise)).max()))
        cases.append(
            StressCase(
                group="emg",
                name=name,
                done=f"cutoffs of {', '.join(f'{s:g}' for s in shares)} of the rate, orders 1 to 8; "
                "20000 samples of noise within ±1",
                happened=f"gain at 0 Hz is 1 within {max(gains):.0e}; output within ±{max(peaks):.2f}",
                error=max(corners),
                bound=1e-5,
                error_of="share of the squared gain at the cutoff (1/2)",
                holds=max(gains) < 1e-13 and max(peaks) < 2.0,
            )
        )
    return cases


def _impossible(*, quick: bool) -> list[StressCase]:  # noqa: ARG001
    nan, inf = float("nan"), float("inf")
    cutoffs = (0.0, -50.0, 500.0, 499.9999, 501.0, 9e-4, nan, inf)
    wrong = [(1e3, cutoff, 4) for cutoff in cutoffs]
    wrong += [(rate, 50.0, 4) for rate in (0.0, -1e3, 100.0, 1e9, nan, inf)]
    wrong += [(1e3, 50.0, order) for order in (0, 9, -1)]
    taken = 0
    for rate_hz, cutoff_hz, order in wrong:
        try:
            ButterworthLowpass(rate_hz, cutoff_hz, order, channels=1)
            taken += 1
        except InvalidValueError:
            pass
    return [
        StressCase(
            group="emg",
            name="impossible filters",
            done="cutoffs of 0, below 0, at, beyond and within 1e-6 of half the rate, NaN, ∞; rates of 0, below 0, "
            "too low, too high, NaN, ∞; orders 0, 9 and -1",
            happened="each is refused with `InvalidValueError`" if taken == 0 else f"{taken} are TAKEN",
            error=taken,
            bound=0,
            error_of="filters taken",
        )
    ]


def _denormals(*, quick: bool) -> list[StressCase]:
    rows = 20_000 if quick else 100_000
    rng = np.random.default_rng(6)
    normal = rng.normal(size=(rows, 3))
    tiny: Samples = rng.integers(-1000, 1001, (rows, 3)) * np.float64(5e-324)
    burst = np.zeros((rows, 3))
    burst[:10] = 1.0
    below_normal = float(np.finfo(np.float64).tiny)
    lowpass = ButterworthLowpass(1e3, channels=3)
    of_tiny = float(np.abs(lowpass.process(tiny)).max())
    decayed = ButterworthLowpass(1e3, channels=3).process(burst)
    subnormal = int(((decayed != 0) & (np.abs(decayed) < below_normal)).sum())
    silent = int(np.flatnonzero(np.abs(decayed).max(axis=1))[-1]) + 1
    return [
        StressCase(
            group="emg",
            name="subnormal input",
            done=f"{rows} samples of noise of up to 1000 times 5e-324",
            happened=f"taken as 0: largest output {of_tiny:g}",
            error=float(np.abs(tiny).max()),
            bound=1e-250,
            error_of="absolute, in the unit of the samples",
            holds=of_tiny == 0.0,
            timing=_cost(normal, tiny),
        ),
        StressCase(
            group="emg",
            name="decay to nothing",
            done="ten samples of 1, then silence",
            happened=f"exactly 0 from sample {silent} on; {subnormal} subnormal outputs",
            error=subnormal,
            bound=0,
            error_of="subnormal outputs",
            holds=silent < rows // 2,
            timing=_cost(normal, burst),
        ),
    ]


def _cost(normal: Samples, other: Samples) -> str:
    """Time of one input as a multiple of another's, here and in SciPy; best of interleaved repetitions."""
    lowpass = ButterworthLowpass(1e3, channels=normal.shape[1])
    told = f"{_ratio(lowpass.process, normal, other):.2f} times the time of normal input"
    try:
        from scipy.signal import butter, sosfilt
    except ImportError:
        return told
    sos = butter(ORDER, CUTOFF_HZ, fs=1e3, output="sos")
    return f"{told} (SciPy {_ratio(lambda rows: sosfilt(sos, rows, axis=0), normal, other):.2f})"


def _ratio(run: Callable[[Samples], object], normal: Samples, other: Samples) -> float:
    spent: list[list[int]] = [[], []]
    for _ in range(7):
        for times, rows in zip(spent, (normal, other), strict=True):
            start = time.perf_counter_ns()
            run(rows)
            times.append(time.perf_counter_ns() - start)
    return min(spent[1]) / min(spent[0])


def _not_finite(*, quick: bool) -> list[StressCase]:  # noqa: ARG001
    rng = np.random.default_rng(7)
    clean = rng.normal(size=(3_000, 3))
    bad = rng.choice([np.nan, 1e301, -1e301], size=clean.shape)
    lost = (rng.random(clean.shape) < 0.1) & (np.arange(3_000) > 0)[:, np.newaxis]
    samples = np.where(lost, bad, clean)
    held = clean.copy()
    for row in range(1, len(held)):
        held[row] = np.where(lost[row], held[row - 1], held[row])
    lowpass = ButterworthLowpass(1e3, channels=3)
    got, wanted = lowpass.process(samples), ButterworthLowpass(1e3, channels=3).process(held)
    counted = lowpass.held_samples.tolist() == lost.sum(axis=0).tolist()
    differing = int((got != wanted).sum())

    gap = clean.copy()
    gap[1_000:1_200] = np.nan
    after = ButterworthLowpass(1e3, channels=3).process(gap)
    fresh = ButterworthLowpass(1e3, channels=3).process(clean[1_200:])
    restarted = int((after[1_200:] != fresh).sum()) + int((~np.isfinite(after)).sum())
    return [
        StressCase(
            group="emg",
            name="NaN and ±1e301",
            done="one sample in ten of three channels of noise is not a usable number",
            happened=f"the last good sample stands in; {int(lost.sum())} samples lost, "
            f"{'all counted' if counted else 'WRONGLY counted'}",
            error=differing,
            bound=0,
            error_of="outputs unlike the filtered held signal, bit for bit",
            holds=counted and bool(np.isfinite(got).all()),
        ),
        StressCase(
            group="emg",
            name="200 ms of NaN",
            done="noise with a gap of 200 samples at 1 kHz",
            happened="finite all through; afterwards the filter starts afresh, settled on the first good sample",
            error=restarted,
            bound=0,
            error_of="outputs not finite, or unlike a fresh filter's, bit for bit",
        ),
    ]


EMG_CASES = [_impulse_and_step, _sample_rates, _cutoffs, _impossible, _denormals, _not_finite]
"""The cases of this group, each a function of ``quick``."""
