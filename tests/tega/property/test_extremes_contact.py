"""Contact metrics (Eq 1 to 6) at their extremes, each with every way of reading the equations."""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction
from itertools import product
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from reference.extremes import Extreme, relative
from tega.tactile import ContactMetrics, contact_metrics, read_contact
from tega_figures.exact import ExactContact, exact_contact

Image = NDArray[np.uint8]
Weights = tuple[float, float, float]

LUMA: Weights = (0.299, 0.587, 0.114)
ALL_WAYS: list[Any] = list(product(("signed", "rectified", "absolute"), ("spatial", "intensity")))
SHAPE = (240, 320, 3)
few = settings(max_examples=8)
seeds = st.integers(0, 2**32 - 1)


def extreme(name: str) -> Extreme:
    # Each number is rounded once or twice from exact sums.
    return Extreme("contact", name, 1e-15, "relative, worst number")


EVEN = extreme("even frames")
ONE_PIXEL = extreme("one pixel")
SHIFT = extreme("uniform shift")
CROSSING = extreme("signed mass crossing zero")
LARGEST = extreme("4096×4096")
FAINT = extreme("contrast 1 of 255")
NEGATIVE = extreme("negative weights")
HUGE = extreme("weights of 1e300")
TINY = extreme("tiny weights")
UNSEEN = extreme("only tiny weights seen")


def error(got: ContactMetrics, exact: ExactContact) -> float:
    """Return the largest relative error; infinite where something is wrong that has to be exact."""
    if (got.in_contact, got.eda, got.peak_xy) != (exact.in_contact, exact.eda, exact.peak_xy):
        return float("inf")
    errors = [relative(got.mass, exact.mass), relative(got.peak, exact.peak)]
    if exact.centroid_xy is None or exact.spread is None or exact.threshold is None:
        return max(errors) if np.isnan([*got.centroid_xy, got.spread, got.threshold]).all() else float("inf")
    for centre, true in zip(got.centroid_xy, exact.centroid_xy, strict=True):
        errors.append(relative(centre, true, max(abs(true), Fraction(1))))
    errors += [
        relative(got.spread, exact.spread),
        relative(got.threshold, exact.threshold, exact.threshold_parts),
        relative(got.cci, exact.cci),
    ]
    return max(errors)


def held(
    line: Extreme, frame: Image, baseline: Image, *, weights: Weights = LUMA, ways: Iterable[Any] = ALL_WAYS
) -> None:
    for difference, spread in ways:
        how = {"weights": weights, "difference": difference, "spread": spread}
        line.hold(error(contact_metrics(frame, baseline, **how), exact_contact(frame, baseline, **how)))


def blob(
    shape: tuple[int, int, int], centre: tuple[float, float], radius: float, height: int
) -> NDArray[np.int16]:
    """Return a round bump of whole grey values, the same in every channel: (H, W, 1)."""
    rows, columns = np.ogrid[: shape[0], : shape[1]]
    square = ((columns - centre[0]) ** 2 + (rows - centre[1]) ** 2) / radius**2
    return np.floor(height * np.clip(1 - square, 0, None)).astype(np.int16)[..., np.newaxis]


def noise(seed: int) -> tuple[Image, Image]:
    """Return a small frame and its baseline, both of noise."""
    rng = np.random.default_rng(seed)
    baseline = rng.integers(0, 128, (24, 32, 3), np.uint8)
    return rng.integers(64, 256, (24, 32, 3), np.uint8), baseline


def even(rng: np.random.Generator) -> tuple[Image, Image]:
    """Return black, grey, saturated or gone dark: any even frame on any other."""
    level, still = rng.choice([0, 90, 255, *rng.integers(0, 256, 2)], 2)
    return np.full(SHAPE, level, np.uint8), np.full(SHAPE, still, np.uint8)


def one_pixel(rng: np.random.Generator) -> tuple[Image, Image]:
    """Return one pixel of any brightness in a black frame, now and then the last."""
    lone = np.zeros(SHAPE, np.uint8)
    y, x = (239, 319) if rng.random() < 0.2 else rng.integers(0, SHAPE[:2])
    lone[y, x] = rng.integers(1, 256)
    return lone, np.zeros(SHAPE, np.uint8)


def brighter(rng: np.random.Generator) -> tuple[Image, Image]:
    """Return a frame of which every pixel is 1 to 40 counts brighter than its baseline."""
    baseline = rng.integers(60, 120, SHAPE, np.uint8)
    return baseline + rng.integers(1, 41, dtype=np.uint8), baseline


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize(("line", "made"), [(EVEN, even), (ONE_PIXEL, one_pixel), (SHIFT, brighter)])
def test_frames_without_a_dent(line: Extreme, made: Any, seed: int) -> None:
    frame, baseline = made(np.random.default_rng(seed))
    held(line, frame, baseline)
    assert not read_contact(frame, baseline, reading="live").in_contact


@pytest.mark.parametrize("extra", range(-3, 4))
def test_a_signed_mass_that_crosses_zero(extra: int) -> None:
    bumps = blob(SHAPE, (90.0, 120.0), 40.0, 50) - blob(SHAPE, (230.0, 120.0), 40.0, 50)
    frame = (100 + bumps + np.zeros(SHAPE, np.int16)).astype(np.uint8)
    # The bumps cancel to the last count; a few counts at one pixel carry the mass across zero.
    frame[20, 300] = 100 + extra
    held(
        CROSSING, frame, np.full(SHAPE, 100, np.uint8), ways=[("signed", "intensity"), ("signed", "spatial")]
    )


@pytest.mark.slow
def test_the_largest_frame() -> None:
    shape = (4096, 4096, 3)
    baseline = np.full(shape, 40, np.uint8)
    frame = (40 + blob(shape, (2900.5, 1200.25), 900.0, 200) + np.zeros(shape, np.int16)).astype(np.uint8)
    frame[-1, -1] = 0
    held(LARGEST, frame, baseline, ways=[("signed", "intensity"), ("rectified", "spatial")])


@few
@given(seeds, st.floats(40, 280), st.floats(40, 200), st.floats(1, 40))
@example(2, 200.0, 80.0, 35.0)
def test_a_contrast_of_one_count(seed: int, x: float, y: float, radius: float) -> None:
    baseline = np.random.default_rng(seed).integers(60, 120, SHAPE, np.uint8)
    held(FAINT, baseline + (blob(SHAPE, (x, y), radius, 40) > 0).astype(np.uint8), baseline)


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
    ids=lambda one: getattr(one, "name", one),
)
def test_weights(line: Extreme, weights: Weights) -> None:
    held(line, *noise(3), weights=weights)


@few
@given(seeds, st.sampled_from([(1.0, 1e-300, 0.0), (0.5, 5e-324, 0.5)]))
@example(3, (1.0, 1e-300, 0.0))
@example(3, (0.5, 5e-324, 0.5))
def test_only_tiny_weights_are_seen(seed: int, weights: Weights) -> None:
    baseline = noise(seed)[1]
    green = baseline.copy()
    green[4:20, 6:28, 1] = 255
    held(UNSEEN, green, baseline, weights=weights)
