"""Controller and joint model against exact references, and what must hold for any sequence of levels."""

from __future__ import annotations

from fractions import Fraction
from itertools import chain, repeat

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from reference import hand as reference
from tega.hand import (
    CLOSURE_POSES_RAD,
    JOINT_LIMITS_RAD,
    LEVEL_TORQUE_FACTORS,
    TICK_S,
    TORQUE_LIMITS,
    HandController,
    JointModel,
    ModelledHand,
)
from tega.wire import allegro_angle_counts, allegro_angles_rad, allegro_torque_frames

LOW, HIGH = JOINT_LIMITS_RAD.T
KP = [1.5] * 12 + [2.0] * 4

levels = st.lists(
    st.tuples(st.integers(1, 5), st.one_of(st.integers(1, 6), st.integers(1, 150))), min_size=1, max_size=12
).map(lambda runs: list(chain.from_iterable(repeat(level, n) for level, n in runs)))
angles = hnp.arrays(np.float64, 16, elements=st.floats(-2.9, 2.9))
velocities = hnp.arrays(np.float64, 16, elements=st.floats(-20, 20))
torques = hnp.arrays(np.float64, 16, elements=st.floats(-2, 2))


@settings(max_examples=12)
@given(requested=levels, start=st.integers(1, 5))
def test_targets_are_the_exact_mixture_of_minimum_jerk_moves(requested: list[int], start: int) -> None:
    pose = CLOSURE_POSES_RAD[start - 1]
    controller = HandController()
    exact = reference.shares(requested, start)
    for tick, level in enumerate(requested):
        controller.step(pose, level)
        if tick % 17 == 0 or tick == len(requested) - 1:
            wanted = [float(a) for a in reference.mix(exact[tick], CLOSURE_POSES_RAD.tolist())]
            assert controller.target_rad is not None
            np.testing.assert_allclose(controller.target_rad, wanted, rtol=0, atol=1e-14)


@settings(max_examples=25)
@given(measured=st.lists(angles, min_size=1, max_size=12), level=st.floats(1, 5), device_id=st.integers(0, 3))
def test_a_cycle_between_both_ends_of_the_cable_is_its_steps_one_by_one(measured, level, device_id) -> None:
    whole, parts = HandController(), HandController()
    for true_rad in measured:
        shown_rad = allegro_angles_rad(allegro_angle_counts(true_rad))
        frames = allegro_torque_frames(parts.step(shown_rad, level), device_id=device_id)
        # A hand whose number nobody gave is number 0.
        number = {"device_id": device_id} if device_id else {}
        assert whole.step_encoded(true_rad, level, **number) == frames


@settings(max_examples=15)
@given(data=st.data(), requested=levels.map(lambda ticks: ticks[:300:25]))
def test_torques_follow_the_stated_law(data: st.DataObject, requested: list[int]) -> None:
    controller = HandController()
    controller.reset(CLOSURE_POSES_RAD[0])
    last = [Fraction(0)] * 16
    for level, row in zip(requested, reference.shares(requested, 1), strict=True):
        measured, speeds = data.draw(angles), data.draw(velocities)
        got = controller.step(measured, level, velocities_rad_s=speeds)
        target = reference.mix(row, CLOSURE_POSES_RAD.tolist())
        (factor,) = reference.mix(row, [[f] for f in LEVEL_TORQUE_FACTORS.tolist()])
        last = [
            reference.torque(
                target[j] - Fraction(measured[j]),
                Fraction(speeds[j]),
                last[j],
                kp=KP[j],
                kd=0.08,
                limit=factor * Fraction(TORQUE_LIMITS[j]),
            )
            for j in range(16)
        ]
        np.testing.assert_allclose(got, [float(t) for t in last], rtol=0, atol=1e-13)


@settings(max_examples=40)
@given(requested=levels, start=angles)
def test_targets_stay_inside_and_slow_for_any_start_and_levels(requested, start) -> None:
    controller = HandController()
    before = np.clip(start, LOW, HIGH)
    for level in requested:
        torque = controller.step(start, level)
        target = controller.target_rad
        assert target is not None
        assert (target >= LOW).all()
        assert (target <= HIGH).all()
        assert (np.abs(target - before) < 3.0 * TICK_S).all()
        assert (np.abs(torque) <= TORQUE_LIMITS).all()
        before = target


@given(start=angles, drive=st.lists(torques, min_size=1, max_size=6), constant=st.floats(0.001, 1.0))
def test_the_model_is_the_stated_difference_equation(start, drive, constant) -> None:
    model = JointModel(start, full_duty_speed_rad_s=9.5, time_constant_s=constant)
    got = np.array([model.step(t) for t in drive])
    for j in (0, 5, 12, 15):
        low, high = JOINT_LIMITS_RAD[j]
        tenth = Fraction(1, 10)
        begin = reference.clamp(Fraction(start[j]), Fraction(low) - tenth, Fraction(high) + tenth)
        wanted = reference.joint(
            begin, [t[j] for t in drive], low=low, high=high, speed=9.5, constant=constant
        )
        np.testing.assert_allclose(got[:, j], [float(a) for a in wanted], rtol=0, atol=1e-13)


@settings(max_examples=8)
@given(requested=levels, start=angles, added=st.floats(0, 1))
def test_one_call_a_cycle_is_the_same_as_two(requested, start, added) -> None:
    together = ModelledHand(model=JointModel(start))
    controller, model = HandController(), JointModel(start)
    for level in requested:
        angle, torque = together.step(level, added)
        np.testing.assert_array_equal(torque, controller.step(model.angles_rad, level, added=added))
        np.testing.assert_array_equal(angle, model.step(torque))
