"""Numbers are formatted for people."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tega.runtime.number_text import number_text


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1e4, "10000"),
        (123456.7, "123457"),
        (0.000059999999999999995, "0.00006"),
        (0.1 + 0.2, "0.3"),
        (-0.0, "0"),
        (-1.5, "-1.5"),
        (0, "0"),
        (7, "7"),
        (math.inf, "inf"),
        (math.nan, "nan"),
    ],
)
def test_a_number_has_no_exponent_and_no_rounding_noise(value: float, text: str) -> None:
    assert number_text(value) == text


def test_a_value_that_rounds_to_zero_has_no_sign() -> None:
    assert number_text(-0.04, decimals=1) == "0.0"
    assert number_text(-0.06, decimals=1) == "-0.1"


@given(st.floats(-1e9, 1e9, allow_subnormal=False), st.integers(2, 15))
def test_the_text_is_the_number_to_its_digits(value: float, digits: int) -> None:
    text = number_text(value, digits)
    assert float(text) == pytest.approx(value, rel=0.6 * 10 ** (1 - digits))
    if value == 0 or abs(value) >= 1e-9:
        assert "e" not in text
