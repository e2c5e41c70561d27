"""The vest law and columns against 60-digit and integer references, at the ends of the number range and along axes."""

from __future__ import annotations

import math
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

from reference import haptics as reference
from reference.extremes import Extreme, relative
from tega import config
from tega.errors import DtypeError, InvalidValueError, ShapeError
from tega.haptics import (
    CONTACT_RULES,
    FINGERS,
    HIGH_SHARE,
    LAYOUTS,
    FeltMap,
    Mirror,
    MotorLevels,
    contact_type,
    intensity,
    vest_frame,
    vest_intensities,
)
from tega.stages.columns import ColumnsOptions
from tega.wire import HAND_FINGERS
from tega_figures.exact import exact_intensity

CCI = [80, 60, 40, 20]
EDA = [10, 0, 100, 55]
SMALLEST, LARGEST = 5e-324, float(np.finfo(np.float64).max)
LAW = Extreme("sigmoid", "maxima from 1e-300 to 1e300", 3e-15, "relative, worst of all values")
ENDS = Extreme("sigmoid", "0, half and the whole maximum", 0, "wrong results")
ORDER = Extreme("sigmoid", "order", 0, "steps at which the intensity falls")
FAR_OUT = Extreme("sigmoid", "ends of the number range", 0, "wrong results")
IMPOSSIBLE = Extreme("sigmoid", "impossible arguments", 0, "arguments taken")
maxima = st.one_of(st.sampled_from([1e-300, 1.0, 1e300]), st.floats(1e-300, 1e300))
finite = st.floats(allow_nan=False, allow_infinity=False)
positive = st.floats(min_value=0, exclude_min=True, allow_infinity=False)
layouts = st.sampled_from(LAYOUTS)
mirrors: st.SearchStrategy[Mirror] = st.sampled_from(["none", "back", "all"])
percents = st.one_of(st.floats(-5, 105), st.integers(-2, 202).map(lambda n: n / 2), finite)
four = st.lists(percents, min_size=4, max_size=4)


@given(
    st.one_of(
        st.tuples(finite, positive), st.tuples(st.floats(-60, 10), maxima).map(lambda p: (p[0] * p[1], p[1]))
    )
)
@example((-60e300, 1e300))
@example((10e-300, 1e-300))
@example((1 / 3, 1.0))
def test_any_finite_input_gives_the_printed_law(of: tuple[float, float]) -> None:
    got, exact = intensity(*of), exact_intensity(*of)
    assert 0.0 <= got <= 100.0
    if exact > Decimal("1e-290"):
        LAW.hold(relative(got, exact))
    else:
        assert got < 1e-289


@given(ratio=st.floats(-2, 3), maximum=st.floats(1e-6, 1e6), end_value=st.floats(1e-6, 0.49))
def test_another_end_value(ratio: float, maximum: float, end_value: float) -> None:
    value = ratio * maximum
    exact = exact_intensity(value, maximum, end_value)
    assert relative(intensity(value, maximum, end_value=end_value), exact) < 1e-13


@given(value=finite, maximum=positive)
def test_linear_law_is_the_share_held_at_its_ends(value: float, maximum: float) -> None:
    exact = 100 * min(Fraction(1), max(Fraction(0), Fraction(value) / Fraction(maximum)))
    assert math.isclose(intensity(value, maximum, law="linear"), exact, rel_tol=1e-15, abs_tol=1e-300)


@given(front=four, back=four, layout=layouts, mirror=mirrors)
def test_every_motor_shows_its_fingers_value(front, back, layout, mirror) -> None:
    frame = vest_frame(front, back, layout=layout, mirror=mirror)
    wanted = reference.wearer_grid(front, back, layout, mirror)
    assert dict(zip(frame.motors.tolist(), frame.intensities.tolist(), strict=True)) == wanted
    assert frame.levels.tolist() == [(15 * i + 50) // 100 for i in frame.intensities.tolist()]


@given(front=four, back=four, layout=layouts, mirror=mirrors)
def test_the_forty_hold_the_layouts_motors_and_nothing_new(front, back, layout, mirror) -> None:
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
    assert set(CONTACT_RULES) == {"none", "mixed", "focal", "broad"}


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


@given(maximum=maxima)
@example(maximum=1e-300)
@example(maximum=1e300)
def test_three_values_are_exact_at_any_maximum_and_the_intensity_never_falls(maximum: float) -> None:
    got = [intensity(share * maximum, maximum) for share in (0.0, 0.5, 1.0)]
    ENDS.hold(sum(a != b for a, b in zip(got, (1.0, 50.0, 99.0), strict=True)))
    results = [intensity(maximum * (i / 2_000 * 3 - 1), maximum) for i in range(2_001)]
    ORDER.hold(int((np.diff(results) < 0).sum()))


def test_the_ends_of_the_number_range() -> None:
    shares = (LARGEST, -LARGEST, SMALLEST, -SMALLEST, LARGEST, SMALLEST)
    full = (SMALLEST, SMALLEST, LARGEST, LARGEST, LARGEST, SMALLEST)
    for value, maximum, wanted in zip(shares, full, (100.0, 0.0, 1.0, 1.0, 99.0, 99.0), strict=True):
        FAR_OUT.hold(intensity(value, maximum) != wanted)


FINITE = st.floats(-1e3, 1e3)
LEADING = arrays.array_shapes(min_dims=1, max_dims=3, min_side=0, max_side=4)


@given(data=st.data(), shape=LEADING, law=st.sampled_from(["logistic", "linear"]))
def test_intensity_of_an_array(data: Any, shape: tuple[int, ...], law: Any) -> None:
    values = data.draw(arrays.arrays(np.float64, shape, elements=FINITE))
    maxima = data.draw(arrays.arrays(np.float64, shape[-1:], elements=st.floats(1e-3, 1e3)))
    found = intensity(values, maxima, law=law)
    assert found.shape == shape
    for index in np.ndindex(shape):
        assert found[index] == intensity(values[index].item(), maxima[index[-1]].item(), law=law)


@given(data=st.data(), shape=LEADING, layout=layouts, mirror=mirrors)
def test_vest_intensities_of_several_moments(data, shape, layout, mirror) -> None:
    front = data.draw(arrays.arrays(np.float64, (*shape, 4), elements=FINITE))
    back = data.draw(arrays.arrays(np.float64, (*shape[-1:], 4), elements=FINITE))
    found = vest_intensities(front, back, layout=layout, mirror=mirror)
    frames = [vest_frame(front[i], back[i[-1]], layout=layout, mirror=mirror) for i in np.ndindex(shape)]
    n_motors = len(vest_frame([0] * 4, [0] * 4, layout=layout).motors)
    assert found.dtype == np.uint8
    assert found.shape == (*shape, n_motors)
    assert found.reshape(-1, n_motors).tolist() == [frame.intensities.tolist() for frame in frames]


NOT_FINITE = (math.nan, math.inf, -math.inf)
NOT_POSITIVE = (*NOT_FINITE, 0.0, -0.0, -1.0, -SMALLEST, -LARGEST)
LAW_OF: dict[str, Any] = {"value": 1.0, "maximum": 1.0}
LINEAR = LAW_OF | {"law": "linear"}
FACES: dict[str, Any] = {"front": CCI, "back": EDA}
ON_32, NONE = {"layout": "paper32"}, np.zeros(32, np.uint8)
NO_MAXIMUM = r"maximum = .*calibrate"
REFUSED: list[tuple[Any, dict[str, Any], str, tuple[Any, ...], type[Exception], str]] = [
    (intensity, LAW_OF, "value", (*NOT_FINITE, [0.0, np.inf]), InvalidValueError, "value = "),
    (intensity, LINEAR, "value", NOT_FINITE, InvalidValueError, "value = "),
    (intensity, LAW_OF, "maximum", NOT_POSITIVE, InvalidValueError, NO_MAXIMUM),
    (intensity, LINEAR, "maximum", NOT_POSITIVE, InvalidValueError, NO_MAXIMUM),
    (intensity, LAW_OF, "end_value", (0.0, 0.5, -0.1, math.nan), InvalidValueError, "end_value = "),
    (intensity, LAW_OF, "law", ("cubic",), InvalidValueError, "law = 'cubic'"),
    (intensity, LAW_OF, "value", (np.array(["a"]),), DtypeError, "no real numbers"),
    (vest_intensities, FACES, "front", ([[np.nan, 0, 0, 0]],), InvalidValueError, "NaN"),
    (vest_intensities, FACES, "front", ([0] * 3, 0.0), ShapeError, "front"),
    (vest_intensities, {"back": np.zeros((3, 4))}, "front", (np.zeros((2, 4)),), ShapeError, "front"),
    (vest_intensities, FACES, "front", (["a"] * 4,), DtypeError, "front"),
    (vest_frame, FACES, "front", ([1, 2, 3],), ShapeError, "front has 3 numbers"),
    (vest_frame, FACES, "back", (list("abcd"),), DtypeError, "back = "),
    (vest_frame, FACES, "layout", ("x41",), InvalidValueError, 'layout = "x41"'),
    (vest_frame, FACES, "mirror", ("x41",), InvalidValueError, "mirror = 'x41'"),
    (MotorLevels, ON_32, "intensities", ([0] * 32,), DtypeError, "a list"),
    (MotorLevels, ON_32, "intensities", (np.zeros(32, np.int64),), DtypeError, "int64"),
    (MotorLevels, ON_32, "intensities", (np.ma.masked_equal(NONE, 0),), InvalidValueError, "32 masked"),
    (MotorLevels, ON_32, "intensities", (NONE[:16],), ShapeError, "16 motors, layout paper32 has 32"),
    (MotorLevels, ON_32, "intensities", (NONE.reshape(2, 16),), ShapeError, "one dimension"),
    (
        MotorLevels,
        ON_32,
        "intensities",
        (NONE + np.uint8(101),),
        InvalidValueError,
        r"intensities\[0\] = 101",
    ),
    (FeltMap, {}, "threshold", (100,), InvalidValueError, "threshold = 100 is out of range: 0 to 99 percent"),
    (FeltMap, {}, "threshold", ([1, 2, 3],), ShapeError, r"threshold has shape \(3,\)"),
    (FeltMap, {}, "threshold", ("weak", {1, 2}), DtypeError, "threshold = .* is not in percent"),
    (
        FeltMap,
        {"threshold": np.int64(20)},
        "step",
        (0, np.array(0)),
        InvalidValueError,
        "step = 0 is out of range",
    ),
    (
        FeltMap,
        {"threshold": [0] * 40},
        "step",
        (math.nan, np.float32("nan")),
        InvalidValueError,
        "step = .*nan",
    ),
    (contact_type, {"cci_norm": 0.5}, "eda_norm", (math.nan,), InvalidValueError, "eda_norm = NaN"),
    (contact_type, {"eda_norm": 0.5}, "cci_norm", (-0.5,), InvalidValueError, r"cci_norm = -0\.5"),
]


@pytest.mark.parametrize(("call", "rest", "name", "values", "error", "text"), REFUSED)
def test_what_makes_no_sense_is_refused_by_name(
    call: Any, rest: dict[str, Any], name: str, values: tuple[Any, ...], error: type[Exception], text: str
) -> None:
    for value in values:
        with pytest.raises(error, match=text):
            call(**rest | {name: value})
    IMPOSSIBLE.hold(0)


@pytest.mark.parametrize("bad", NOT_FINITE)
def test_an_intensity_that_is_not_finite_names_face_and_finger(bad: float) -> None:
    for name, row in zip(FINGERS, np.eye(4), strict=True):
        for face in FACES:
            with pytest.raises(InvalidValueError, match=f"{face} intensity of the {name}"):
                vest_frame(**FACES | {face: np.where(row, bad, 1.0)})


def test_a_frame_is_a_value() -> None:
    frame = vest_frame(CCI, EDA)
    assert frame == vest_frame(CCI, EDA)
    assert hash(frame) == hash(vest_frame(CCI, EDA))
    assert frame != vest_frame(EDA, CCI)
    assert frame != "paper32"
    with pytest.raises(AttributeError):
        frame.layout = "x40"  # type: ignore[misc]
    with pytest.raises(ValueError, match="read-only"):
        frame.intensities[0] = 1
    with pytest.raises(ValueError, match="read-only"):
        frame.motors[0] = 1


def test_the_fingers_have_one_order_of_the_columns_and_one_of_the_hand() -> None:
    assert config.FINGERS is FINGERS
    assert ColumnsOptions().fingers is FINGERS
    assert sorted(HAND_FINGERS) == sorted(FINGERS)
    assert HAND_FINGERS != FINGERS
