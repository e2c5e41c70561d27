"""The EMG filter (Eq 10) at the ends of rates, cutoffs and numbers, and over a hundred million samples."""

from __future__ import annotations

from decimal import Decimal

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from reference.emg import farthest, rounding_bound
from reference.extremes import Extreme
from tega.emg import ButterworthLowpass
from tega.errors import InvalidValueError
from tega_figures.exact import dc_gain, design, filtered, gain_squared

Samples = NDArray[np.float64]

CUTOFF_HZ = 50.0
ORDER = 4
RATES_HZ = {"200 Hz": 200.0, "1 kHz": 1e3, "10 kHz": 1e4, "100 kHz": 1e5, "1 MHz": 1e6}
N_SAMPLES = 2_000
FULL_SCALE = "share of full scale"
few = settings(max_examples=8)
seeds = st.integers(0, 2**32 - 1)

IMPULSE = Extreme("emg", "impulse", 1e-14, FULL_SCALE)
STEP = Extreme("emg", "step", 1e-14, FULL_SCALE)
AT_RATE = {
    name: Extreme("emg", f"{name} sampling", rounding_bound(rate_hz), FULL_SCALE)
    for name, rate_hz in RATES_HZ.items()
}
CORNER = "share of the squared gain at the cutoff (1/2)"
NEAR_0 = Extreme("emg", "cutoff near 0", 1e-5, CORNER)
NEAR_HALF = Extreme("emg", "cutoff near half the rate", 1e-5, CORNER)
IMPOSSIBLE = Extreme("emg", "impossible filters", 0, "filters taken")
SUBNORMAL = Extreme("emg", "subnormal input", 1e-250, "absolute, in the unit of the samples")
DECAY = Extreme("emg", "decay to nothing", 0, "subnormal outputs")
HELD = Extreme("emg", "NaN and ±1e301", 0, "outputs unlike the filtered held signal, bit for bit")
GAP = Extreme("emg", "200 ms of NaN", 0, "outputs not finite, or unlike a fresh filter's, bit for bit")
PERIOD, SETTLING_PERIODS, OFFSET = 100_000, 5, 2048.0
LONG = {
    name: Extreme("emg", f"1e8 samples at {name}", rounding_bound(RATES_HZ[name]), FULL_SCALE)
    for name in ("1 kHz", "1 MHz")
}


@pytest.mark.parametrize("order", range(1, 9))
@pytest.mark.parametrize("line", [IMPULSE, STEP], ids=lambda line: line.name)
def test_impulse_and_step(line: Extreme, order: int) -> None:
    signal = np.zeros(N_SAMPLES) if line is IMPULSE else np.ones(N_SAMPLES)
    signal[0 if line is STEP else 1] = 0.0 if line is STEP else 1.0
    got = ButterworthLowpass(1e3, CUTOFF_HZ, order, channels=1).process(signal)[:, 0]
    line.hold(farthest(got, filtered(design(1e3, CUTOFF_HZ, order), signal.tolist())))


@pytest.mark.parametrize("rate", RATES_HZ)
@few
@given(seed=seeds, offset=st.sampled_from([0.0, 1.0]))
@example(seed=4, offset=1.0)
def test_a_sampling_rate(rate: str, seed: int, offset: float) -> None:
    rate_hz = RATES_HZ[rate]
    signal = np.random.default_rng(seed).integers(-1000, 1001, N_SAMPLES) / 1000.0 + offset
    got = ButterworthLowpass(rate_hz, CUTOFF_HZ, ORDER, channels=1).process(signal)[:, 0]
    exact = filtered(design(rate_hz, CUTOFF_HZ, ORDER), signal.tolist())
    AT_RATE[rate].hold(farthest(got, exact) / (1 + offset))


@pytest.mark.parametrize("line", [NEAR_0, NEAR_HALF], ids=lambda line: line.name)
@given(off=st.floats(1e-6, 1e-3), order=st.integers(1, 8))
@example(off=1e-6, order=8)
@example(off=1e-5, order=7)
def test_a_cutoff_near_an_end(line: Extreme, off: float, order: int) -> None:
    share = off if line is NEAR_0 else 0.5 - off
    lowpass = ButterworthLowpass(1.0, share, order, channels=1)
    sos = lowpass.sos.tolist()
    line.hold(float(abs(2 * gain_squared(sos, share) - 1)))
    assert abs(dc_gain(sos) - 1) < Decimal("1e-13")
    assert np.abs(lowpass.process(np.random.default_rng(5).uniform(-1, 1, 20_000))).max() < 2.0


def test_the_exact_response_of_a_known_filter() -> None:
    # y[n] = (x[n] + x[n-1]) / 2: gain 1 at frequency 0, cos²(π f) elsewhere; half of it at a quarter of the rate.
    mean = [[0.5, 0.5, 0.0, 1.0, 0.0, 0.0]]
    assert dc_gain(mean) == 1
    assert abs(gain_squared(mean, 0.25) - Decimal("0.5")) < Decimal("1e-55")
    for share in (1e-6, 0.125, 0.49):
        assert float(gain_squared(mean, share)) == pytest.approx(np.cos(np.pi * share) ** 2, rel=1e-12)


not_finite = st.sampled_from([float("nan"), float("inf"), float("-inf")])
bad_cutoffs = st.one_of(not_finite, st.floats(max_value=0.0), st.floats(min_value=499.9996))
bad_rates = st.one_of(not_finite, st.floats(max_value=100.0), st.floats(min_value=1e9))
bad_orders = st.one_of(st.integers(-(2**31), 0), st.integers(9, 2**31 - 1))


@given(
    st.one_of(
        st.tuples(st.just(1e3), bad_cutoffs, st.just(4)),
        st.tuples(bad_rates, st.just(CUTOFF_HZ), st.just(4)),
        st.tuples(st.just(1e3), st.just(CUTOFF_HZ), bad_orders),
    )
)
@example((1e3, 499.9999, 4))
@example((1e3, 9e-4, 4))
@example((1e9, 50.0, 4))
@example((100.0, 50.0, 4))
def test_impossible_filters_are_refused(wanted: tuple[float, float, int]) -> None:
    with pytest.raises(InvalidValueError):
        ButterworthLowpass(*wanted, channels=1)
    IMPOSSIBLE.hold(0)


@few
@given(seeds)
def test_subnormal_input_is_taken_as_0(seed: int) -> None:
    tiny = np.random.default_rng(seed).integers(-1000, 1001, (100_000, 3)) * np.float64(5e-324)
    assert not ButterworthLowpass(1e3, channels=3).process(tiny).any()
    SUBNORMAL.hold(float(np.abs(tiny).max()))


@few
@given(st.integers(1, 100), st.floats(1e-6, 1e6))
@example(10, 1.0)
def test_what_decays_comes_to_nothing(n_samples: int, size: float) -> None:
    burst = np.zeros((100_000, 3))
    burst[:n_samples] = size
    decayed = ButterworthLowpass(1e3, channels=3).process(burst)
    assert not decayed[50_000:].any()
    DECAY.hold(int(((decayed != 0) & (np.abs(decayed) < np.finfo(np.float64).tiny)).sum()))


@few
@given(seeds)
@example(7)
def test_the_last_good_sample_stands_in(seed: int) -> None:
    rng = np.random.default_rng(seed)
    clean = rng.normal(size=(3_000, 3))
    lost = (rng.random(clean.shape) < 0.1) & (np.arange(3_000) > 0)[:, np.newaxis]
    samples = np.where(lost, rng.choice([np.nan, 1e301, -1e301], size=clean.shape), clean)
    wanted = clean.copy()
    for row in range(1, len(wanted)):
        wanted[row] = np.where(lost[row], wanted[row - 1], wanted[row])
    for form in (samples, np.ma.masked_array(np.where(lost, 9.0, clean), lost)):
        lowpass = ButterworthLowpass(1e3, channels=3)
        got = lowpass.process(form)
        assert np.isfinite(got).all()
        assert lowpass.held_samples.tolist() == lost.sum(axis=0).tolist()
        HELD.hold(int((got != ButterworthLowpass(1e3, channels=3).process(wanted)).sum()))


@few
@given(seeds, st.integers(1, 2_000))
@example(7, 1_000)
def test_after_a_gap_the_filter_starts_afresh(seed: int, begin: int) -> None:
    clean = np.random.default_rng(seed).normal(size=(3_000, 3))
    gap = clean.copy()
    gap[begin : begin + 200] = np.nan
    after = ButterworthLowpass(1e3, channels=3).process(gap)
    fresh = ButterworthLowpass(1e3, channels=3).process(clean[begin + 200 :])
    GAP.hold(int((after[begin + 200 :] != fresh).sum()) + int((~np.isfinite(after)).sum()))


@pytest.mark.parametrize(
    "n_samples", [1_000_000, pytest.param(100_000_000, marks=pytest.mark.deep)], ids=["1e6", "1e8"]
)
@pytest.mark.parametrize("rate", LONG)
def test_a_long_run_does_not_drift(rate: str, n_samples: int) -> None:
    noise = np.random.default_rng(8).integers(-1000, 1001, PERIOD)
    sine = np.sin(2 * np.pi * 2 * np.arange(PERIOD) / PERIOD)
    # A constant that no binary fraction is.
    signal = OFFSET + np.stack([noise, np.full(PERIOD, 0.1), sine], axis=1)
    wanted, full_scale = sums(signal), np.abs(signal).max(axis=0)
    lowpass, fresh = (ButterworthLowpass(RATES_HZ[rate], CUTOFF_HZ, ORDER, channels=3) for _ in range(2))
    gain = 0.0
    for period in range(n_samples // PERIOD):
        out = lowpass.process(signal)
        assert (np.abs(out).max(axis=0) < 1.5 * full_scale).all()
        if period >= SETTLING_PERIODS:
            gain = max(gain, float(np.abs(sums(out) / wanted - 1).max()))
    for _ in range(SETTLING_PERIODS + 1):
        settled = fresh.process(signal)
    LONG[rate].hold(max(gain, float((np.abs(out - settled) / full_scale).max())))


def sums(rows: Samples) -> Samples:
    by_halves: Samples = np.ascontiguousarray(rows.T).sum(axis=1)
    return by_halves
