"""The EMG chain against exact references, and along leading axes."""

from __future__ import annotations

from fractions import Fraction
from random import Random
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays
from numpy.typing import NDArray

from reference import emg as reference
from tega.emg import BlockMean, ButterworthLowpass, GraspIntent, channel_maxima, fuse_levels, grasp_level
from tega.errors import DtypeError
from tega_figures.exact import filtered

RATES_HZ = [200.0, 250.0, 1e3, 2e3, 1e4, 3e4, 1e5, 1e6]
Samples = NDArray[np.float64]

values = st.floats(-1e6, 1e6, allow_subnormal=False)
level_lists = st.lists(st.integers(1, 5), min_size=1, max_size=9)


@st.composite
def signals(draw: st.DrawFn, *, channels: int | None = None, max_rows: int = 300) -> Samples:
    """Draw bursts, of all channels or of each by itself, on an offset or not: (n, channels)."""
    width = channels or draw(st.integers(1, 6))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    rows = draw(st.integers(0, max_rows))
    muscles = draw(st.sampled_from([1, width]))
    effort = rng.choice([0.01, 0.3, 0.6, 1.5], size=(rows // 20 + 1, muscles)).repeat(20, axis=0)[:rows]
    return draw(st.sampled_from([0.0, 2048.0])) + effort * rng.normal(size=(rows, width))


@st.composite
def chunkings(draw: st.DrawFn) -> tuple[Samples, list[Samples]]:
    whole = draw(signals())
    if draw(st.booleans()) and len(whole):
        rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
        start = rng.integers(len(whole))
        whole[start : start + rng.integers(80), rng.integers(whole.shape[1])] = np.nan
        whole[rng.random(whole.shape) < 0.02] = np.inf
    cuts = sorted(draw(st.lists(st.integers(0, len(whole)), max_size=8)))
    return whole, np.split(whole, cuts)


@given(st.lists(values, max_size=200), st.integers(1, 40))
def test_block_means_equal_the_exact_ones(samples: list[float], tau: int) -> None:
    got = BlockMean(tau).process(np.array(samples, np.float64))[:, 0]
    wanted = reference.block_means(samples, tau)
    assert len(got) == len(wanted)
    for block, (mean, exact) in enumerate(zip(got, wanted, strict=True)):
        size = sum(abs(Fraction(x)) for x in samples[block * tau : (block + 1) * tau])
        # The second term is what is left where everything cancels.
        assert abs(Fraction(mean) - exact) <= Fraction(1e-15) * abs(exact) + Fraction(1e-28) * size


@given(st.floats(-1e300, 1e300), st.floats(1e-300, 1e300))
@example(0.00225, 0.003)
@example(5e-324, 5e-324)
def test_levels_equal_the_exact_ones(value: float, maximum: float) -> None:
    assert grasp_level(value, maximum) == reference.level(value, maximum)


@given(st.integers(1, 10**6), st.integers(0, 5), st.integers(-8, 8), st.integers(-3, 3))
def test_levels_equal_the_exact_ones_around_borders(mantissa: int, k: int, exponent: int, ulps: int) -> None:
    maximum = float(f"{mantissa}e{exponent}")
    border = float(Fraction(mantissa * k, 4) * Fraction(10) ** exponent)
    tolerated = float(Fraction(border) * (1 - reference.TOLERANCE))
    for centre in (border, tolerated):
        value = centre
        for _ in range(abs(ulps)):
            value = float(np.nextafter(value, np.inf * ulps))
        assert grasp_level(value, maximum) == reference.level(value, maximum)
    assert grasp_level(border, maximum) == min(k + 1, 5)


@given(level_lists, st.randoms(use_true_random=False))
def test_fusion_equals_the_exact_one_in_any_order(levels: list[int], random: Random) -> None:
    assert fuse_levels(levels) == reference.fuse(levels)
    random.shuffle(levels)
    assert fuse_levels(levels) == reference.fuse(levels)


@settings(max_examples=20)
@given(
    st.sampled_from(RATES_HZ), st.integers(1, 8), st.lists(st.floats(-1, 1), min_size=1, max_size=80), values
)
def test_the_filter_follows_its_difference_equation(rate_hz, order, swing, offset) -> None:
    lowpass = ButterworthLowpass(rate_hz, order=order, channels=1)
    samples = offset + np.array(swing)
    exact = filtered([(*row[:3], *row[4:]) for row in lowpass.sos.tolist()], samples.tolist())
    full_scale = max(1.0, float(np.abs(samples).max()))
    got = lowpass.process(samples)[:, 0]
    assert reference.farthest(got, exact) <= reference.rounding_bound(rate_hz) * full_scale


@given(
    chunkings(), st.integers(1, 50), st.sampled_from(["raw", "envelope"]), st.sampled_from(["paper", "live"])
)
def test_intent_is_identical_for_every_chunking(cut, tau, kind, preset) -> None:
    whole, chunks = cut
    maxima = np.full(whole.shape[1], 0.7)
    one, many = (GraspIntent(200, maxima, tau=tau, kind=kind, preset=preset) for _ in range(2))
    parts = [(many.process(chunk), many.levels) for chunk in chunks]
    np.testing.assert_array_equal(np.concatenate([fused for fused, _ in parts]), one.process(whole))
    np.testing.assert_array_equal(np.concatenate([levels for _, levels in parts]), one.levels)
    assert (many.bad_channels, many.holding) == (one.bad_channels, one.holding)


@given(signals(), st.randoms(use_true_random=False), st.integers(-60, 60), st.sampled_from(["paper", "live"]))
def test_neither_the_order_of_the_channels_nor_their_unit_matters(samples, random, exponent, preset) -> None:
    order, scale = list(range(samples.shape[1])), 2.0**exponent
    random.shuffle(order)
    maxima = np.linspace(0.3, 1.3, len(order))
    one = GraspIntent(200, maxima, tau=20, preset=preset)
    other = GraspIntent(200, maxima[order] * scale, tau=20, preset=preset)
    np.testing.assert_array_equal(other.process(samples[:, order] * scale), one.process(samples))
    np.testing.assert_array_equal(other.levels, one.levels[:, order])


@given(signals(max_rows=600), st.integers(1, 40), st.sampled_from(["rectified", "envelope"]))
def test_presets_equal_the_reference(samples: Samples, tau: int, kind: Any) -> None:
    envelope = np.abs(samples)
    maxima = np.linspace(0.4, 1.2, samples.shape[1])
    smooth = ButterworthLowpass(200, channels=samples.shape[1]).process(envelope)
    means = BlockMean(tau).process(smooth).tolist()
    paper = GraspIntent(200, maxima, tau=tau, kind=kind, preset="paper").process(envelope)
    live = GraspIntent(200, maxima, tau=tau, kind=kind, preset="live").process(envelope)
    assert paper.tolist() == reference.paper_levels(means, maxima.tolist())
    assert live.tolist() == reference.live_levels(means, maxima.tolist(), tau / 200)


@given(signals(channels=2, max_rows=600), st.floats(0, 100))
def test_maxima_are_percentiles_of_the_block_means(samples: Samples, percentile: float) -> None:
    envelope = np.abs(samples) + 1.0
    means = BlockMean(20).process(ButterworthLowpass(200, channels=2).process(envelope))
    if len(means) == 0:
        return
    got = channel_maxima(envelope, 200, tau=20, kind="envelope", percentile=percentile)
    np.testing.assert_allclose(got, np.percentile(means, percentile, axis=0), rtol=1e-14)


@given(
    data=st.data(),
    shape=arrays.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=4),
    channels=st.integers(1, 5),
)
def test_levels_of_several_blocks(data: Any, shape: tuple[int, ...], channels: int) -> None:
    values = data.draw(
        arrays.arrays(np.float64, (*shape, channels), elements=st.floats(-1, 20) | st.just(np.nan))
    )
    maxima = data.draw(arrays.arrays(np.float64, (channels,), elements=st.floats(0.1, 10)))
    levels = grasp_level(values, maxima)
    assert levels.shape == values.shape
    fused = np.asarray(fuse_levels(levels))
    assert fused.shape == shape
    for index in np.ndindex(shape):
        each = [grasp_level(v.item(), m.item()) for v, m in zip(values[index], maxima, strict=True)]
        assert levels[index].tolist() == each
        assert fused[index] == fuse_levels(each)


@settings(max_examples=20)
@given(seed=st.integers(0, 99), shape=arrays.array_shapes(min_dims=1, max_dims=2, max_side=3))
def test_maxima_of_several_contractions(seed: int, shape: tuple[int, ...]) -> None:
    samples = np.random.default_rng(seed).normal(size=(*shape, 400, 3))
    found = channel_maxima(samples, 1000, tau=50)
    assert found.shape == (*shape, 3)
    for index in np.ndindex(shape):
        assert found[index].tolist() == channel_maxima(samples[index], 1000, tau=50).tolist()


def test_levels_of_truths_are_refused_and_a_masked_sample_is_missing() -> None:
    assert grasp_level(np.ma.masked_array([9.0, 5.0], [True, False]), np.array(4.0)).tolist() == [1, 5]
    with pytest.raises(DtypeError):
        grasp_level(np.array([True]), 1.0)
