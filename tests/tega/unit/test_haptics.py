"""Examples, edges and bad input of the vest law and columns."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tega import config
from tega.errors import DtypeError, InvalidValueError, ShapeError
from tega.haptics import CONTACT_RULES, FINGERS, MotorLevels, contact_type, intensity, vest_frame
from tega.stages.columns import ColumnsOptions
from tega.wire import HAND_FINGERS

CCI = [80, 60, 40, 20]
EDA = [10, 0, 100, 55]


@pytest.mark.parametrize("law", ["logistic", "linear"])
def test_numbers_outside_their_range_are_refused_by_name(law: Any) -> None:
    for value in (math.nan, math.inf, -math.inf):
        with pytest.raises(InvalidValueError, match="value = "):
            intensity(value, 1.0, law=law)
    for maximum in (0.0, -1.0, math.nan, math.inf):
        with pytest.raises(InvalidValueError, match=r"maximum = .*calibrate"):
            intensity(1.0, maximum, law=law)
    for end_value in (0.0, 0.5, -0.1, math.nan):
        with pytest.raises(InvalidValueError, match="end_value = "):
            intensity(1.0, 1.0, end_value=end_value)
    with pytest.raises(InvalidValueError, match="law = 'cubic'"):
        intensity(1.0, 1.0, law="cubic")  # type: ignore[call-overload]


def test_paper32_is_the_known_frame() -> None:
    frame = vest_frame(CCI, EDA)
    assert frame.layout == "paper32"
    assert frame.intensities.tolist() == CCI * 4 + EDA * 4
    assert frame.motors.tolist() == [*range(16), *range(20, 36)]
    assert frame.levels.tolist() == [12, 9, 6, 3] * 4 + [2, 0, 15, 8] * 4
    assert frame.x40().tolist() == CCI * 4 + [0] * 4 + EDA * 4 + [0] * 4


@pytest.mark.parametrize("bad", [math.nan, math.inf, -math.inf])
def test_an_intensity_that_is_not_finite_names_face_and_finger(bad: float) -> None:
    for finger, name in enumerate(FINGERS):
        values = [1.0, 1.0, 1.0, 1.0]
        values[finger] = bad
        with pytest.raises(InvalidValueError, match=f"front intensity of the {name}"):
            vest_frame(values, EDA)
        with pytest.raises(InvalidValueError, match=f"back intensity of the {name}"):
            vest_frame(CCI, np.array(values))


def test_wrong_count_kind_and_choice_are_refused() -> None:
    anything: Any = "x41"
    with pytest.raises(ShapeError, match="front has 3 numbers"):
        vest_frame([1, 2, 3], EDA)
    with pytest.raises(DtypeError, match="back = "):
        vest_frame(CCI, ["a", "b", "c", "d"])  # type: ignore[list-item]
    with pytest.raises(InvalidValueError, match='layout = "x41"'):
        vest_frame(CCI, EDA, layout=anything)
    with pytest.raises(InvalidValueError, match="mirror = 'x41'"):
        vest_frame(CCI, EDA, mirror=anything)


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


def test_a_frame_made_by_hand_is_checked() -> None:
    anything: Any = [0] * 32
    assert MotorLevels("paper32", np.zeros(32, np.uint8)).levels.sum() == 0
    with pytest.raises(DtypeError, match="a list"):
        MotorLevels("paper32", anything)
    with pytest.raises(DtypeError, match="int64"):
        MotorLevels("paper32", np.zeros(32, np.int64))
    with pytest.raises(ShapeError, match="16 motors, layout paper32 has 32"):
        MotorLevels("paper32", np.zeros(16, np.uint8))
    with pytest.raises(ShapeError, match="one dimension"):
        MotorLevels("paper32", np.zeros((2, 16), np.uint8))
    with pytest.raises(InvalidValueError, match=r"intensities\[3\] = 101"):
        MotorLevels("x16", np.array([100, 0, 0, 101] + [0] * 12, np.uint8))


def test_every_contact_type_has_its_rule() -> None:
    seen = {contact_type(c, e) for c, e in [(0, 0), (0.9, 0.1), (0.1, 0.9), (0.9, 0.9), (0.1, 0.1)]}
    assert seen == set(CONTACT_RULES)
    with pytest.raises(InvalidValueError, match="eda_norm = NaN"):
        contact_type(0.5, math.nan)
    with pytest.raises(InvalidValueError, match=r"cci_norm = -0\.5"):
        contact_type(-0.5, 0.5)


def test_the_fingers_have_one_order_of_the_columns_and_one_of_the_hand() -> None:
    assert config.FINGERS is FINGERS
    assert ColumnsOptions().fingers is FINGERS
    assert sorted(HAND_FINGERS) == sorted(FINGERS)
    assert HAND_FINGERS != FINGERS
