"""The arm's rotations, frames and filter against exact references, its gate, and that it can still stop."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from reference.arm import one_euro, quaternions, turn_between, vectors
from tega.arm import FRAMES, GateSettings, MappingSettings, StampedPose
from tega.arm import rotation as so3
from tega.arm.frames import OneEuro, ToBase
from tega.arm.gate import PoseGate
from tega.arm.motion import closing_speed


@given(a=quaternions, b=quaternions, v=vectors)
def test_rotations_are_those_of_scipy(a, b, v) -> None:
    theirs_a, theirs_b = Rotation.from_quat(a), Rotation.from_quat(b)
    assert turn_between(so3.multiply(a, b), (theirs_a * theirs_b).as_quat()) < 1e-12
    np.testing.assert_allclose(so3.rotate(a, v), theirs_a.apply(v), atol=1e-12)
    np.testing.assert_allclose(so3.to_matrix(a), theirs_a.as_matrix(), atol=1e-12)
    assert turn_between(so3.from_matrix(theirs_a.as_matrix()), a) < 1e-7
    assert np.abs(so3.multiply(a, so3.inverse(a)) - so3.IDENTITY).max() < 1e-12


@given(direction=vectors.filter(lambda v: np.linalg.norm(v) > 1e-3), power=st.floats(-12, 0.497))
def test_exp_and_log_are_those_of_scipy(direction, power) -> None:
    vector = direction / np.linalg.norm(direction) * 10**power  # from 1e-12 rad to within 1e-3 of half a turn
    theirs = Rotation.from_rotvec(vector)
    assert np.abs(so3.same_side(so3.exp(vector), theirs.as_quat()) - theirs.as_quat()).max() < 1e-15
    np.testing.assert_allclose(so3.log(so3.exp(vector)), vector, rtol=1e-12, atol=1e-15)
    np.testing.assert_allclose(so3.log(theirs.as_quat()), theirs.as_rotvec(), rtol=1e-9, atol=1e-14)


@given(q=quaternions)
def test_both_signs_have_one_logarithm(q) -> None:
    np.testing.assert_array_equal(so3.log(q), so3.log(-q))


@given(axis=vectors.filter(lambda v: np.linalg.norm(v) > 0.1), total=st.floats(0.1, 20))
def test_the_logarithm_goes_on_past_half_a_turn(axis, total) -> None:
    axis = axis / np.linalg.norm(axis)
    last = np.zeros(3)
    for angle in np.linspace(0, total, 50):
        last = so3.log_near(so3.exp(axis * angle), last)
        np.testing.assert_allclose(last, axis * angle, atol=1e-9)


@pytest.mark.parametrize("frame", sorted(FRAMES))
@given(q=quaternions, yaw=st.floats(-3.1, 3.1), base=st.floats(-3.1, 3.1), mirror=st.booleans(), v=vectors)
@settings(max_examples=10)
def test_axes_change_as_m_r_mt(frame, q, yaw, base, mirror, v) -> None:
    to_base = ToBase(MappingSettings(frame=frame, yaw_rad=yaw, base_yaw_rad=base, mirror=mirror))
    m, r = to_base.matrix, Rotation.from_quat(q).as_matrix()
    place, turn = to_base(StampedPose(0, v, q))
    np.testing.assert_allclose(place, m @ v, atol=1e-12)
    np.testing.assert_allclose(so3.to_matrix(turn), m @ r @ m.T, atol=1e-12)
    np.testing.assert_allclose(m @ m.T, np.eye(3), atol=1e-12)


steps_s = st.lists(st.floats(1e-3, 0.2), min_size=1, max_size=40)


@given(
    data=st.data(), dts=steps_s, cutoff=st.floats(0.1, 10), beta=st.floats(0, 50), d_cutoff=st.floats(0.1, 10)
)
def test_along_one_axis_it_is_the_published_filter(data, dts, cutoff, beta, d_cutoff) -> None:
    xs = data.draw(st.lists(st.floats(-1, 1), min_size=len(dts), max_size=len(dts)))
    times = np.cumsum(dts).tolist()
    wanted = one_euro(zip(times, xs, strict=True), cutoff, beta, d_cutoff)
    ours, turns = OneEuro(cutoff, beta, d_cutoff), OneEuro(cutoff, beta, d_cutoff, turns=True)
    for number, (t_s, x, y) in enumerate(zip(times, xs, wanted, strict=True)):
        dt_s = t_s - times[number - 1] if number else 0.0
        np.testing.assert_allclose(ours.step(np.array([0.0, x, 0.0]), dt_s), [0, y, 0], atol=1e-12)
        turned = turns.step(so3.exp(np.array([0.0, x, 0.0])), dt_s)  # about one axis turns add like numbers
        np.testing.assert_allclose(so3.log(turned), [0, y, 0], atol=1e-12)


@given(x=vectors, q=quaternions, dts=steps_s, flips=st.lists(st.booleans(), min_size=40, max_size=40))
def test_a_constant_is_left_as_it_is_whatever_its_sign(x, q, dts, flips) -> None:
    place, turn = OneEuro(1.5, 10, 1), OneEuro(1.5, 2, 1, turns=True)
    for dt_s, flip in zip(dts, flips, strict=False):
        np.testing.assert_array_equal(place.step(x, dt_s), x)
        assert turn_between(turn.step(-q if flip else q, dt_s), q) < 1e-12


@given(r=quaternions, dts=steps_s, data=st.data())
@settings(max_examples=15)
def test_the_filter_does_not_care_for_the_axes(r, dts, data) -> None:
    rotation = Rotation.from_quat(r)
    straight, turned = OneEuro(1.5, 10, 1), OneEuro(1.5, 10, 1)
    straight_q, turned_q = OneEuro(1.5, 2, 1, turns=True), OneEuro(1.5, 2, 1, turns=True)
    for dt_s in dts:
        x, v = data.draw(vectors), data.draw(vectors)
        np.testing.assert_allclose(
            rotation.apply(straight.step(x, dt_s)), turned.step(rotation.apply(x), dt_s), atol=1e-12
        )
        one = straight_q.step(so3.exp(v), dt_s)
        other = turned_q.step(so3.exp(rotation.apply(v)), dt_s)
        assert turn_between(so3.multiply(so3.multiply(r, one), so3.inverse(r)), other) < 1e-9


@given(
    speed=st.floats(-2, 2),
    distance=st.floats(0, 2),
    acceleration=st.floats(0.5, 20),
    dt_s=st.floats(1e-3, 0.1),
)
def test_after_a_tick_at_the_closing_speed_one_can_still_stop(speed, distance, acceleration, dt_s) -> None:
    s = closing_speed(speed, distance, acceleration, dt_s)
    tau = abs(s - speed) / acceleration
    if s > 0 and tau <= dt_s:
        route = (s + speed) / 2 * tau + s * (dt_s - tau)
        assert route + s * s / (2 * acceleration) == pytest.approx(distance, abs=1e-9)
    elif s == 0 and distance > 0:
        assert speed * speed / (2 * acceleration) >= distance - 1e-12  # it comes too late to stop


@given(speed=st.floats(0, 1.4), n=st.integers(2, 30), hz=st.sampled_from([30, 60, 90]))
def test_the_gate_lets_pass_what_a_hand_can_do(speed, n, hz) -> None:
    gate = PoseGate(GateSettings())
    for i in range(n):
        t_ns = round(i * 1e9 / hz) + 1
        place = np.array([speed * i / hz, 0, 0])
        assert gate.refusal(StampedPose(t_ns, place, so3.exp(place * 3)), t_ns) == ""
