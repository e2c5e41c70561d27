"""Equations 1 to 6 and the paper reading against exact fractions, also at their extremes."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import assume, example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from numpy.typing import NDArray

from reference.extremes import Extreme, relative
from tega.tactile import ContactGate, ContactMetrics, contact_metrics, read_contact
from tega_figures.exact import ExactContact, exact_contact, exact_paper, printed

Image = NDArray[np.uint8]

DIFFERENCES = st.sampled_from(["signed", "rectified", "absolute"])
SPREADS = st.sampled_from(["spatial", "intensity"])
ORDERS = st.sampled_from(["bgr", "rgb"])


@st.composite
def weight_triples(draw: st.DrawFn) -> tuple[float, float, float]:
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
    shape = (draw(st.integers(1, max_side)), draw(st.integers(1, max_side)), 3)
    values = st.one_of(st.integers(0, 255), st.sampled_from([0, 1, 254, 255]))
    image = hnp.arrays(np.uint8, shape, elements=values, fill=st.just(0))
    return draw(image), draw(image)


@st.composite
def dense(draw: st.DrawFn) -> tuple[Image, Image]:
    shape, level = (draw(st.integers(1, 12)), draw(st.integers(1, 12)), 3), draw(st.integers(0, 255))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    return rng.integers(level // 2, level + 1, shape, dtype=np.uint8), np.zeros(shape, np.uint8)


def error(got: ContactMetrics, exact: ExactContact) -> float:
    """Return the worst number's share of what it should be."""
    if (got.in_contact, got.eda, got.peak_xy) != (exact.in_contact, exact.eda, exact.peak_xy):
        return float("inf")
    errors = [relative(got.mass, exact.mass), relative(got.peak, exact.peak), relative(got.cci, exact.cci)]
    if exact.centroid_xy is None or exact.spread is None or exact.threshold is None:
        return max(errors) if np.isnan([*got.centroid_xy, got.spread, got.threshold]).all() else float("inf")
    for centre, true in zip(got.centroid_xy, exact.centroid_xy, strict=True):
        errors.append(relative(centre, true, max(abs(true), Fraction(1))))
    errors += [
        relative(got.spread, exact.spread),
        relative(got.threshold, exact.threshold, exact.threshold_parts),
    ]
    return max(errors)


def assert_equals_exact(got: ContactMetrics, exact: ExactContact) -> None:
    assert got.peak == float(exact.peak)
    assert max(relative(got.mass, exact.mass), relative(got.cci, exact.cci)) <= 1e-15
    assert error(got, exact) <= 1e-12


READINGS = st.fixed_dictionaries(
    {
        "weights": weight_triples(),
        "order": ORDERS,
        "difference": DIFFERENCES,
        "spread": SPREADS,
        "factor": st.one_of(
            st.just(1.28), st.floats(-4, 4), st.sampled_from([0.0, 1e-9, 0.1, 2.5, -1.0, 1e6])
        ),
        "centroid_value": st.sampled_from(["nearest", "bilinear"]),
    }
)


@given(pairs(), READINGS)
def test_every_reading_equals_the_fractions(pair, reading) -> None:
    assert_equals_exact(contact_metrics(*pair, **reading), exact_contact(*pair, **reading))


@given(pairs(), st.sampled_from([0.0, 0.114, 6.0, 99.5, 255.0]), st.integers(0, 50), DIFFERENCES)
def test_the_gate_counts_pixels_over_its_floor(pair, noise_floor, min_pixels, difference) -> None:
    gate = ContactGate(noise_floor, min_pixels)
    m = contact_metrics(*pair, difference=difference, gate=gate)
    exact = exact_contact(*pair, difference=difference, gate=(noise_floor, min_pixels))
    assert_equals_exact(m, exact)


@given(pairs(max_side=9) | dense(), ORDERS)
def test_the_paper_reading_equals_the_fractions(pair, order) -> None:
    frame, baseline = pair
    found = read_contact(frame, baseline, reading="paper", order=order)
    assert_equals_exact(found, exact_paper(frame, baseline, order))


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


Weights = tuple[float, float, float]

LUMA: Weights = (0.299, 0.587, 0.114)
ALL_WAYS: list[Any] = list(product(("signed", "rectified", "absolute"), ("spatial", "intensity")))
SHAPE = (240, 320, 3)
few = settings(max_examples=8)
seeds = st.integers(0, 2**32 - 1)


NEGATIVE, HUGE, TINY = "negative weights", "weights of 1e300", "tiny weights"
LINES = (
    *("even frames", "one pixel", "uniform shift", "signed mass crossing zero", "4096×4096"),
    *("contrast 1 of 255", NEGATIVE, HUGE, TINY, "only tiny weights seen"),
)
# Each number is rounded once or twice from exact sums.
EXTREMES = {name: Extreme("contact", name, 1e-15, "relative, worst number") for name in LINES}


def held(
    line: str, frame: Image, baseline: Image, *, weights: Weights = LUMA, ways: Iterable[Any] = ALL_WAYS
) -> None:
    for difference, spread in ways:
        how = {"weights": weights, "difference": difference, "spread": spread}
        found = error(contact_metrics(frame, baseline, **how), exact_contact(frame, baseline, **how))
        EXTREMES[line].hold(found)


def blob(
    shape: tuple[int, int, int], centre: tuple[float, float], radius: float, height: int
) -> NDArray[np.int16]:
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    square = ((columns - centre[0]) ** 2 + (rows - centre[1]) ** 2) / radius**2
    return np.floor(height * np.clip(1 - square, 0, None)).astype(np.int16)[..., np.newaxis]


def noise(seed: int) -> tuple[Image, Image]:
    rng = np.random.default_rng(seed)
    baseline = rng.integers(0, 128, (24, 32, 3), np.uint8)
    return rng.integers(64, 256, (24, 32, 3), np.uint8), baseline


def even(rng: np.random.Generator) -> tuple[Image, Image]:
    level, still = rng.choice([0, 90, 255, *rng.integers(0, 256, 2)], 2)
    return np.full(SHAPE, level, np.uint8), np.full(SHAPE, still, np.uint8)


def one_pixel(rng: np.random.Generator) -> tuple[Image, Image]:
    lone = np.zeros(SHAPE, np.uint8)
    y, x = (239, 319) if rng.random() < 0.2 else rng.integers(0, SHAPE[:2])
    lone[y, x] = rng.integers(1, 256)
    return lone, np.zeros(SHAPE, np.uint8)


def brighter(rng: np.random.Generator) -> tuple[Image, Image]:
    baseline = rng.integers(60, 120, SHAPE, np.uint8)
    return baseline + rng.integers(1, 41, dtype=np.uint8), baseline


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(
    ("line", "made"), [("even frames", even), ("one pixel", one_pixel), ("uniform shift", brighter)]
)
def test_frames_without_a_dent(line: str, made: Any, seed: int) -> None:
    frame, baseline = made(np.random.default_rng(seed))
    held(line, frame, baseline)
    assert not read_contact(frame, baseline, reading="live").in_contact


@pytest.mark.parametrize("extra", range(-3, 4))
def test_a_signed_mass_that_crosses_zero(extra: int) -> None:
    bumps = blob(SHAPE, (90.0, 120.0), 40.0, 50) - blob(SHAPE, (230.0, 120.0), 40.0, 50)
    frame = (100 + bumps + np.zeros(SHAPE, np.int16)).astype(np.uint8)
    # The bumps cancel to the last count; a few counts at one pixel carry the mass across zero.
    frame[20, 300] = 100 + extra
    ways = [("signed", "intensity"), ("signed", "spatial")]
    held("signed mass crossing zero", frame, np.full(SHAPE, 100, np.uint8), ways=ways)


@pytest.mark.slow
def test_the_largest_frame() -> None:
    shape = (4096, 4096, 3)
    baseline = np.full(shape, 40, np.uint8)
    frame = (40 + blob(shape, (2900.5, 1200.25), 900.0, 200) + np.zeros(shape, np.int16)).astype(np.uint8)
    frame[-1, -1] = 0
    held("4096×4096", frame, baseline, ways=[("signed", "intensity"), ("rectified", "spatial")])


@few
@given(seeds, st.floats(40, 280), st.floats(40, 200), st.floats(1, 40))
@example(2, 200.0, 80.0, 35.0)
def test_a_contrast_of_one_count(seed: int, x: float, y: float, radius: float) -> None:
    baseline = np.random.default_rng(seed).integers(60, 120, SHAPE, np.uint8)
    held("contrast 1 of 255", baseline + (blob(SHAPE, (x, y), radius, 40) > 0).astype(np.uint8), baseline)


@pytest.mark.parametrize(
    ("line", "weights"),
    [
        (NEGATIVE, (2.0, -1.5, 0.5)),
        (NEGATIVE, (-1.0, 3.0, -1.0)),
        (NEGATIVE, (0.5, 1.5, -1.0)),
        (HUGE, (1e300, -1e300, 1.0)),
        (HUGE, (1.0, 1e300, -1e300)),
        (TINY, (1.0, 1e-300, -1e-300)),
        (TINY, (1e-300, 1.0, 5e-324)),
        (TINY, (1.0, 5e-324, 0.0)),
    ],
)
def test_weights(line: str, weights: Weights) -> None:
    held(line, *noise(3), weights=weights)


@few
@given(seeds, st.sampled_from([(1.0, 1e-300, 0.0), (0.5, 5e-324, 0.5)]))
@example(3, (1.0, 1e-300, 0.0))
@example(3, (0.5, 5e-324, 0.5))
def test_only_tiny_weights_are_seen(seed: int, weights: Weights) -> None:
    baseline = noise(seed)[1]
    green = baseline.copy()
    green[4:20, 6:28, 1] = 255
    held("only tiny weights seen", green, baseline, weights=weights)
