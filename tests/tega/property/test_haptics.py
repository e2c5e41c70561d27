"""The vest law and columns against 60-digit and integer references."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from reference import haptics as reference
from tega.haptics import (
    HIGH_SHARE,
    LAYOUTS,
    FeltMap,
    Layout,
    Mirror,
    MotorLevels,
    contact_type,
    intensity,
    vest_frame,
)
from tega_figures.exact import exact_intensity

finite = st.floats(allow_nan=False, allow_infinity=False)
positive = st.floats(min_value=0, exclude_min=True, allow_infinity=False)
layouts = st.sampled_from(LAYOUTS)
mirrors: st.SearchStrategy[Mirror] = st.sampled_from(["none", "back", "all"])
percents = st.one_of(st.floats(-5, 105), st.integers(-2, 202).map(lambda n: n / 2), finite)
four = st.lists(percents, min_size=4, max_size=4)


def relative_error(got: float, exact: Decimal) -> float:
    return float(abs((Decimal(got) - exact) / exact))


@given(value=finite, maximum=positive)
def test_any_finite_input_gives_the_printed_law(value: float, maximum: float) -> None:
    got, exact = intensity(value, maximum), exact_intensity(value, maximum)
    assert 0.0 <= got <= 100.0
    if exact > Decimal("1e-290"):
        assert relative_error(got, exact) < 3e-15
    else:
        assert got < 1e-289


@given(ratio=st.floats(-2, 3), maximum=st.floats(1e-6, 1e6), end_value=st.floats(1e-6, 0.49))
def test_another_end_value(ratio: float, maximum: float, end_value: float) -> None:
    value = ratio * maximum
    exact = exact_intensity(value, maximum, end_value)
    assert relative_error(intensity(value, maximum, end_value=end_value), exact) < 1e-13


@given(value=finite, other=finite, maximum=positive)
def test_more_of_the_metric_never_gives_less(value: float, other: float, maximum: float) -> None:
    low, high = sorted([value, other])
    assert intensity(low, maximum) <= intensity(high, maximum)


@given(value=finite, maximum=positive)
def test_linear_law_is_the_share_held_at_its_ends(value: float, maximum: float) -> None:
    exact = 100 * min(Fraction(1), max(Fraction(0), Fraction(value) / Fraction(maximum)))
    assert math.isclose(intensity(value, maximum, law="linear"), exact, rel_tol=1e-15, abs_tol=1e-300)


@given(front=four, back=four, layout=layouts, mirror=mirrors)
def test_every_motor_shows_its_fingers_value(
    front: list[float], back: list[float], layout: Layout, mirror: Mirror
) -> None:
    frame = vest_frame(front, back, layout=layout, mirror=mirror)
    wanted = reference.wearer_grid(front, back, layout, mirror)
    assert dict(zip(frame.motors.tolist(), frame.intensities.tolist(), strict=True)) == wanted
    assert frame.levels.tolist() == [(15 * i + 50) // 100 for i in frame.intensities.tolist()]


@given(front=four, back=four, layout=layouts, mirror=mirrors)
def test_the_forty_hold_the_layouts_motors_and_nothing_new(
    front: list[float], back: list[float], layout: Layout, mirror: Mirror
) -> None:
    frame = vest_frame(front, back, layout=layout, mirror=mirror)
    x40 = frame.x40()
    assert x40.shape == (40,)
    assert x40.dtype == np.uint8
    np.testing.assert_array_equal(x40[frame.motors], frame.intensities)
    if layout == "paper32":
        assert not x40[16:20].any()
        assert not x40[36:].any()
    else:
        full = vest_frame(front, back, layout="x40", mirror=mirror)
        np.testing.assert_array_equal(x40, full.intensities)


@given(cci=st.floats(0, 2), eda=st.floats(0, 2))
def test_the_reading_rule(cci: float, eda: float) -> None:
    if eda == 0:
        wanted = "none"
    elif (cci >= HIGH_SHARE) == (eda >= HIGH_SHARE):
        wanted = "mixed"
    else:
        wanted = "focal" if cci > eda else "broad"
    assert contact_type(cci, eda) == wanted


@given(seed=st.integers(0, 2**32 - 1), equal=st.booleans())
def test_every_motor_is_as_many_noticeable_steps_above_its_threshold(seed: int, equal: bool) -> None:
    rng = np.random.default_rng(seed)
    threshold: list[int] = [0] * 40 if equal else rng.integers(0, 100, 40).tolist()
    step: list[float] = [7.0] * 40 if equal else (rng.integers(1, 401, 40) / 4).tolist()
    intensities: list[int] = rng.integers(0, 101, 40).tolist()
    n = min((100 - t) / Fraction(s) for t, s in zip(threshold, step, strict=True))
    frame = MotorLevels("x40", np.array(intensities, np.uint8))
    felt = FeltMap(threshold=threshold, step=step).apply(frame).intensities.tolist()
    for got, i, t, s in zip(felt, intensities, threshold, step, strict=True):
        exact = t + Fraction(i, 100) * n * Fraction(s) if i else Fraction(0)
        assert abs(got - exact) <= Fraction(1, 2) + Fraction(1, 10**9)
