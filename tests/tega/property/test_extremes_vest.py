"""Vest intensity (Eq 7 to 9) at the ends of the number range."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from reference.extremes import Extreme, relative
from tega.errors import InvalidValueError
from tega.haptics import intensity
from tega_figures.exact import exact_intensity

SMALLEST, LARGEST = 5e-324, float(np.finfo(np.float64).max)
LAW = Extreme("sigmoid", "maxima from 1e-300 to 1e300", 3e-15, "relative, worst of all values")
ENDS = Extreme("sigmoid", "0, half and the whole maximum", 0, "wrong results")
ORDER = Extreme("sigmoid", "order", 0, "steps at which the intensity falls")
FAR_OUT = Extreme("sigmoid", "ends of the number range", 0, "wrong results")
IMPOSSIBLE = Extreme("sigmoid", "impossible arguments", 0, "arguments taken")
maxima = st.one_of(st.sampled_from([1e-300, 1.0, 1e300]), st.floats(1e-300, 1e300))


@given(share=st.floats(-60.0, 10.0), maximum=maxima)
@example(share=-60.0, maximum=1e300)
@example(share=10.0, maximum=1e-300)
@example(share=1 / 3, maximum=1.0)
def test_the_law_at_any_maximum(share: float, maximum: float) -> None:
    value = share * maximum
    exact = exact_intensity(value, maximum)
    LAW.hold(relative(intensity(value, maximum), exact))


@given(maximum=maxima)
def test_three_values_are_exact_at_any_maximum(maximum: float) -> None:
    got = [intensity(share * maximum, maximum) for share in (0.0, 0.5, 1.0)]
    ENDS.hold(sum(a != b for a, b in zip(got, (1.0, 50.0, 99.0), strict=True)))


@given(maximum=maxima)
@example(maximum=1e-300)
@example(maximum=1e300)
def test_the_intensity_never_falls(maximum: float) -> None:
    results = [intensity(maximum * (i / 2_000 * 3 - 1), maximum) for i in range(2_001)]
    ORDER.hold(int((np.diff(results) < 0).sum()))


@pytest.mark.parametrize(
    ("value", "maximum", "wanted"),
    [
        (LARGEST, SMALLEST, 100.0),
        (-LARGEST, SMALLEST, 0.0),
        (SMALLEST, LARGEST, 1.0),
        (-SMALLEST, LARGEST, 1.0),
        (LARGEST, LARGEST, 99.0),
        (SMALLEST, SMALLEST, 99.0),
    ],
)
def test_the_ends_of_the_number_range(value: float, maximum: float, wanted: float) -> None:
    FAR_OUT.hold(intensity(value, maximum) != wanted)


not_finite = st.sampled_from([float("nan"), float("inf"), float("-inf")])


@given(
    st.one_of(
        st.tuples(st.floats(), st.one_of(not_finite, st.floats(max_value=0.0))),
        st.tuples(not_finite, st.floats()),
    )
)
@example((1.0, 0.0))
@example((1.0, -1.0))
def test_impossible_arguments_are_refused(arguments: tuple[float, float]) -> None:
    with pytest.raises(InvalidValueError):
        intensity(*arguments)
    IMPOSSIBLE.hold(0)
