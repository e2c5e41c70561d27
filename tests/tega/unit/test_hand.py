"""Examples, edges and bad input of controller and joint model."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from tega.errors import DtypeError, InvalidValueError, ShapeError
from tega.hand import (
    CLOSURE_POSES_RAD,
    JOINT_LIMITS_RAD,
    JOINT_NAMES,
    LEVEL_TORQUE_FACTORS,
    MOST_ADDED_LEVELS,
    TORQUE_LIMITS,
    HandController,
    JointModel,
    ModelledHand,
)

OPEN = CLOSURE_POSES_RAD[0]


def test_constants_have_the_hands_shape_and_cannot_be_changed() -> None:
    assert CLOSURE_POSES_RAD.shape == (5, 16)
    assert JOINT_LIMITS_RAD.shape == (16, 2)
    assert TORQUE_LIMITS.tolist() == [0.3125, 0.5625, 0.375, 0.2375] * 3 + [0.4375, 0.3375, 0.225, 0.225]
    assert LEVEL_TORQUE_FACTORS.tolist() == [0.3, 0.3, 0.5, 0.7, 1.0]
    assert (JOINT_NAMES[0], JOINT_NAMES[5], JOINT_NAMES[15]) == ("index_j0", "middle_j1", "thumb_j3")
    for constant in (CLOSURE_POSES_RAD, JOINT_LIMITS_RAD, TORQUE_LIMITS, LEVEL_TORQUE_FACTORS):
        assert not constant.flags.writeable


@pytest.mark.parametrize(
    ("level", "added", "says"),
    [
        *((level, 0.0, f"level = {level} ") for level in (0, 6, -1, 2**40)),
        *((3, added, "added") for added in (math.nan, math.inf, -0.01, MOST_ADDED_LEVELS + 0.01)),
    ],
)
def test_a_level_or_an_addition_out_of_range_gives_no_torque(level: int, added: float, says: str) -> None:
    out = np.full(16, 9.0)
    with pytest.raises(InvalidValueError, match=says):
        HandController().step(OPEN, level, added=added, out=out)
    assert not out.any()
    with pytest.raises(InvalidValueError, match=says):
        ModelledHand().step(level, added)


def test_level_and_target_follow_the_calls() -> None:
    controller = HandController()
    assert controller.target_rad is None
    assert controller.level is None
    assert controller.step(OPEN, np.int64(4)).tolist() == [0.0] * 16  # type: ignore[arg-type]
    assert controller.level == 4
    np.testing.assert_array_equal(controller.target_rad, OPEN)


def test_out_is_filled_and_may_be_the_angles() -> None:
    plain, lent, shared = HandController(), HandController(), HandController()
    out = np.empty(16)
    for angle in np.linspace(0, 0.4, 50):
        measured = OPEN + angle
        wanted = plain.step(measured, 3)
        assert lent.step(measured, 3, out=out) is out
        np.testing.assert_array_equal(out, wanted)
        np.testing.assert_array_equal(shared.step(measured, 3, out=measured), wanted)


def test_any_stride_and_kind_of_numbers_is_taken() -> None:
    wanted = HandController().step(OPEN, 3)
    spread = np.zeros(32)
    spread[::2] = OPEN
    spread.flags.writeable = False
    for angles in (spread[::2], OPEN.tolist(), OPEN.astype(">f8")):
        np.testing.assert_array_equal(HandController().step(angles, 3), wanted)
    assert HandController().step([0] * 16, 1).shape == (16,)


@pytest.mark.parametrize(
    ("angles", "more", "error", "says"),
    [
        (OPEN[:15], {"out": np.ones(16)}, ShapeError, r"angles_rad has shape \(15,\), \(16,\) is needed"),
        ("open", {}, DtypeError, "angles_rad has dtype <U4"),
        ([[1.0], [2.0, 3.0]], {}, ShapeError, "angles_rad"),
        (np.ma.masked_less(OPEN, 9), {}, InvalidValueError, "angles_rad has 16 masked values"),
        (OPEN, {"out": np.zeros(16, np.float32)}, DtypeError, "out is float32"),
        (OPEN, {"out": np.zeros(17)}, ShapeError, "out has shape"),
        (OPEN, {"out": OPEN}, InvalidValueError, "read-only"),
        (OPEN + 3, {}, InvalidValueError, "angles_rad of index_j0 = "),
        (
            OPEN,
            {"velocities_rad_s": np.full(16, np.nan)},
            InvalidValueError,
            "velocities_rad_s of index_j0 = NaN",
        ),
    ],
)
def test_arrays_of_the_wrong_kind_are_refused(angles, more, error, says) -> None:
    with pytest.raises(error, match=says):
        HandController().step(angles, 1, **more)
    assert len(angles) != 15 or not more["out"].any()


def test_poses_of_ones_own_are_checked_and_used() -> None:
    poses = np.clip(CLOSURE_POSES_RAD + 0.03, None, JOINT_LIMITS_RAD[:, 1] - 0.04)
    controller = HandController(poses_rad=poses)
    controller.reset(poses[0])
    for _ in range(201):
        controller.step(poses[0], 2)
    np.testing.assert_array_equal(controller.target_rad, poses[1])
    poses[3, 13] = 2.54
    with pytest.raises(InvalidValueError, match=r"pose 4: thumb_j1 = 2\.54 rad"):
        HandController(poses_rad=poses)
    with pytest.raises(ShapeError, match="poses_rad has shape"):
        HandController(poses_rad=poses[:4])


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"kp": -1}, "kp of index_j0"),
        ({"kd": [0.1] * 15 + [math.inf]}, "kd of thumb_j3"),
        ({"error_limit_rad": 0.0}, "error_limit_rad"),
        ({"torque_limits": 1.1}, "torque_limits of index_j0"),
        ({"level_factors": [0, 0.5, 0.5, 0.5, 2]}, "level_factors = 2 "),
        ({"slew_per_tick": math.nan}, "slew_per_tick"),
    ],
)
def test_gains_no_hand_should_get_are_refused(settings: dict[str, Any], message: str) -> None:
    with pytest.raises(InvalidValueError, match=message):
        HandController(**settings)


class Interrupted:
    """An array that Ctrl-C interrupts the reading of; no Exception, as a panic of native code is none."""

    def __array__(self, *_: Any, **__: Any) -> Any:
        raise KeyboardInterrupt


def test_whatever_is_raised_no_torque_is_left_to_be_sent() -> None:
    controller, torques = HandController(), np.full(16, 0.7)
    with pytest.raises(KeyboardInterrupt):
        controller.step(Interrupted(), 3, out=torques)
    assert not torques.any()


def test_the_model_refuses_nan_and_constants_that_no_joint_has() -> None:
    model = JointModel(OPEN)
    with pytest.raises(InvalidValueError, match="torques of index_j0 = NaN"):
        model.step(np.full(16, np.nan))
    np.testing.assert_array_equal(model.angles_rad, OPEN)
    wrongs: tuple[tuple[dict[str, float], str], ...] = (
        ({"time_constant_s": 1e-320}, "1e-6 to 1e6"),
        ({"full_duty_speed_rad_s": 1e308}, "1e-6 to 1e6"),
    )
    for wrong, says in wrongs:
        with pytest.raises(InvalidValueError, match=says):
            JointModel(np.zeros(16), **wrong)
    with pytest.raises(ShapeError, match="torques"):
        model.step([0.0])


def test_full_duty_without_load_leads_to_the_vendors_speed() -> None:
    model = JointModel(JOINT_LIMITS_RAD[:, 0] - 0.1, time_constant_s=0.005)
    for _ in range(30):
        model.step(np.ones(16))
    np.testing.assert_allclose(model.velocities_rad_s, math.radians(60) / 0.11, rtol=1e-5)
