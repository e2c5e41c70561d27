"""Equations 1 to 6 and the paper reading against exact fractions, and what must not change them."""

from __future__ import annotations

import math
from decimal import Decimal, localcontext
from fractions import Fraction

import numpy as np
from hypothesis import assume, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from tega.tactile import ContactGate, ContactMetrics, contact_metrics, read_contact
from tega_figures.exact import ExactContact, exact_contact, exact_paper, printed

Image = NDArray[np.uint8]

DIFFERENCES = st.sampled_from(["signed", "rectified", "absolute"])
SPREADS = st.sampled_from(["spatial", "intensity"])
CENTROID_VALUES = st.sampled_from(["nearest", "bilinear"])
ORDERS = st.sampled_from(["bgr", "rgb"])
FACTORS = st.one_of(st.just(1.28), st.floats(-4, 4), st.sampled_from([0.0, 1e-9, 0.1, 2.5, -1.0, 1e6]))


@st.composite
def weight_triples(draw: st.DrawFn) -> tuple[float, float, float]:
    """Weights that add up to 1 in decimals: round ones, long ones, negative ones and tiny ones."""
    kind = draw(st.sampled_from(["luma", "thousandths", "long", "tiny"]))
    if kind == "luma":
        return (0.299, 0.587, 0.114)
    if kind == "thousandths":
        red, green = draw(st.integers(-2000, 2000)), draw(st.integers(-2000, 2000))
        return (red / 1000, green / 1000, (1000 - red - green) / 1000)
    if kind == "long":
        r, g = draw(st.floats(-1, 1)), draw(st.floats(-1, 1))
        b = 1 - r - g
        total = printed(r) + printed(g) + printed(b)
        assume(abs(total - 1) <= Fraction(1, 10**9))
        return (r, g, b)
    tiny = draw(st.sampled_from([1e-300, 5e-324, -1e-30, 1e-12]))
    return (tiny, 0.25, 0.75)


@st.composite
def pairs(draw: st.DrawFn, max_side: int = 7) -> tuple[Image, Image]:
    """Frame and baseline of the same small shape, sparse or dense, equal or not."""
    shape = (draw(st.integers(1, max_side)), draw(st.integers(1, max_side)), 3)
    values = st.one_of(st.integers(0, 255), st.sampled_from([0, 1, 254, 255]))
    image = hnp.arrays(np.uint8, shape, elements=values, fill=st.just(0))
    return draw(image), draw(image)


def close(value: float, exact: Fraction | Decimal | None, rel: float = 1e-12) -> bool:
    if exact is None:
        return math.isnan(value)
    with localcontext() as ctx:
        ctx.prec = 60
        if isinstance(exact, Fraction):
            exact = Decimal(exact.numerator) / Decimal(exact.denominator)
        # Below 1e-307 a double has fewer digits; one unit there is 5e-324.
        return abs(Decimal(value) - exact) <= abs(exact) * Decimal(rel) + Decimal("1e-323")


def assert_equals_exact(m: ContactMetrics, exact: ExactContact) -> None:
    assert m.in_contact == exact.in_contact
    assert m.eda == exact.eda
    assert m.peak == float(exact.peak)
    assert m.peak_xy == exact.peak_xy
    assert close(m.mass, exact.mass, 1e-15)
    assert close(m.cci, exact.cci, 1e-15)
    assert close(m.spread, exact.spread)
    assert close(m.threshold, exact.threshold)
    for value, wanted in zip(m.centroid_xy, exact.centroid_xy or (None, None), strict=True):
        assert close(value, wanted)


@given(pairs(), weight_triples(), ORDERS, DIFFERENCES, SPREADS, FACTORS, CENTROID_VALUES)
def test_every_reading_equals_the_fractions(
    pair: tuple[Image, Image], weights, order, difference, spread, factor, centroid_value
) -> None:
    reading = {
        "weights": weights,
        "order": order,
        "difference": difference,
        "spread": spread,
        "factor": factor,
        "centroid_value": centroid_value,
    }
    assert_equals_exact(contact_metrics(*pair, **reading), exact_contact(*pair, **reading))


@given(pairs(), st.sampled_from([0.0, 0.114, 6.0, 99.5, 255.0]), st.integers(0, 50), DIFFERENCES)
def test_the_gate_counts_pixels_over_its_floor(pair, noise_floor, min_pixels, difference) -> None:
    gate = ContactGate(noise_floor, min_pixels)
    m = contact_metrics(*pair, difference=difference, gate=gate)
    exact = exact_contact(*pair, difference=difference, gate=(noise_floor, min_pixels))
    assert_equals_exact(m, exact)


@given(pairs(max_side=9), ORDERS)
def test_the_paper_reading_equals_the_fractions(pair, order) -> None:
    assert_equals_exact(
        read_contact(*pair, reading="paper", order=order), exact_paper(pair[0], pair[1], order)
    )


@given(st.integers(1, 12), st.integers(1, 12), st.integers(0, 255), st.integers(0, 2**32 - 1))
def test_the_paper_reading_of_dense_frames_equals_the_fractions(height, width, level, seed) -> None:
    rng = np.random.default_rng(seed)
    frame = rng.integers(level // 2, level + 1, (height, width, 3), dtype=np.uint8)
    baseline = np.zeros_like(frame)
    assert_equals_exact(read_contact(frame, baseline, reading="paper"), exact_paper(frame, baseline))


@given(pairs(), DIFFERENCES, SPREADS)
def test_strides_and_read_only_memory_change_nothing(pair, difference, spread) -> None:
    frame, baseline = pair
    plain = contact_metrics(frame, baseline, difference=difference, spread=spread)
    twisted = np.asfortranarray(frame)
    sparse = np.repeat(np.repeat(frame, 2, axis=0), 3, axis=1)[::2, ::3]
    sparse.flags.writeable = False
    backward = baseline[::-1, ::-1, ::-1].copy()[::-1, ::-1, ::-1]
    for other in (twisted, sparse):
        np.testing.assert_equal(contact_metrics(other, backward, difference=difference, spread=spread), plain)
