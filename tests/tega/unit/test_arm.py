"""The arm's chain in single cases: states and their times, locks, walls, and who may steer."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from reference.arm_bench import FORWARD, MIDDLE, MS, Bench
from tega.arm import (
    ArmChain,
    ArmSettings,
    GateSettings,
    LimitSettings,
    MappingSettings,
    Pose,
    StampedPose,
    WatchdogSettings,
)
from tega.arm import rotation as so3
from tega.arm.gate import PoseGate
from tega.errors import InvalidValueError


@pytest.fixture
def bench() -> Bench:
    return Bench().take_hold()


@pytest.mark.parametrize("axis", range(3))
def test_a_locked_axis_stays_and_a_scaled_one_goes_less(axis: int) -> None:
    gains = [0.5, 0.5, 0.5]
    gains[axis] = 0.0
    bench = Bench(gain_xyz=tuple(gains), gain_turn=tuple(gains)).take_hold()
    for _ in range(10):
        bench.turn = so3.multiply(so3.exp(np.full(3, 0.04)), bench.turn)
        bench.go(100, move=(0.01, 0.01, 0.01))
    bench.go(3000)
    wanted = [0.05, 0.05, 0.05]
    wanted[axis] = 0.0
    assert bench.away_m == wanted
    turned = so3.between(FORWARD, bench.arm.quaternion_xyzw)
    np.testing.assert_allclose(turned, 4 * np.array(wanted), atol=1e-6)


def test_at_a_wall_it_slides_and_comes_back_at_once(bench: Bench) -> None:
    bench.go(4000, move=(0.6, 0.1, 0))
    bench.go(1000)
    assert bench.away_m == [0.2, 0.1, 0]
    bench.go(1000, move=(-0.05, 0, 0))
    bench.go(1000)
    assert bench.away_m == [0.15, 0.1, 0]


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({}, ""),
        ({"valid": False}, "the tracker calls it lost"),
        ({"position_m": [0, math.nan, 0]}, "a number in it is not finite"),
        ({"quaternion_xyzw": [0, 0, 0, math.inf]}, "a number in it is not finite"),
        ({"quaternion_xyzw": [0, 0, 0, 1.002]}, "its quaternion has length 1.002, not 1"),
        ({"quaternion_xyzw": [0, 0, 0, 0]}, "its quaternion has length 0, not 1"),
        ({"position_m": [0, -150, 0]}, "it lies 150 m away"),
        ({"position_m": [0, 0]}, r"it is not one place and one turn: shapes (2,) and (4,)"),
        ({"t_ns": 0}, "it is not newer than the last"),
        ({"t_ns": 50 * MS}, "it is 150 ms old"),
        ({"t_ns": 230 * MS}, "it lies 30 ms in the future"),
        ({"position_m": [0.11, 0, 0]}, "it jumped by 110 mm"),
        ({"position_m": [0.09, 0, 0], "t_ns": 120 * MS}, "it jumped by 90 mm"),  # 20 ms at 3 m/s are 60 mm
        ({"quaternion_xyzw": so3.exp(np.array([0, 0.7, 0]))}, "it jumped by 0.70 rad"),
        ({"quaternion_xyzw": so3.exp(np.array([0, 0.3, 0])), "t_ns": 120 * MS}, "it jumped by 0.30 rad"),
    ],
)
def test_the_gate_says_why(change: dict[str, Any], says: str) -> None:
    gate = PoseGate(GateSettings())
    first_ns = 40 * MS if change.get("t_ns") == 50 * MS else 100 * MS
    assert gate.refusal(StampedPose(first_ns, [0, 0, 0], [0, 0, 0, 1]), first_ns) == ""
    pose = StampedPose(190 * MS, [0, 0, 0], [0, 0, 0, 1])._replace(**change)
    assert gate.refusal(pose, 200 * MS) == says


def test_a_jump_is_believed_once_the_hand_was_lost(bench: Bench) -> None:
    bench.hand_m = bench.hand_m + 0.73
    assert bench.go(150).state == "holding"
    assert "jumped by 1264 mm" in bench.last.reason
    assert bench.go(200).state == "idle"
    bench.take_hold()
    assert bench.away_m == [0, 0, 0]


def test_a_tracker_that_jumps_away_and_back_has_no_vote_until_it_is_steady(bench: Bench) -> None:
    for jumps in range(1, 4):
        bench.hand_m = bench.hand_m + 0.73
        bench.go(10)
        bench.hand_m = bench.hand_m - 0.73
        following = bench.go(90).state == "following"
        assert following == (jumps < 3), bench.last.reason
    assert "the tracker has no vote: it jumped by 1264 mm" in bench.last.reason
    assert bench.chain.doubt in bench.last.reason
    before = bench.away_m
    assert bench.go(390, move=(0.05, 0, 0)).state == "holding"
    assert bench.away_m == before
    # By itself, and from where it rests: the clutch is still pressed.
    assert bench.go(30).state == "following"
    assert bench.chain.doubt == ""
    assert bench.away_m == before


def test_a_clutch_that_is_pressed_from_the_start_does_nothing() -> None:
    bench = Bench()
    assert bench.go(500).state == "idle"
    assert "press it again" in bench.last.reason
    assert bench.last.target is None
    bench.take_hold()


def test_the_dead_man_switch_holds_at_once_and_its_return_takes_hold_anew(bench: Bench) -> None:
    bench.go(500, move=(0.05, 0, 0))
    bench.dead_man = False
    assert bench.go(10).state == "holding"
    bench.go(1000, move=(0.2, 0, 0))
    held = bench.away_m
    assert held[0] < 0.06
    bench.dead_man = True
    assert bench.go(500).state == "following"
    assert bench.away_m == held
    assert bench.last.engagements == 2


@pytest.mark.parametrize(
    ("after_ms", "state"),
    [(90, "following"), (120, "holding"), (240, "holding"), (270, "idle"), (1500, "idle")],
)
def test_a_forearm_that_the_tracker_loses(bench: Bench, after_ms: int, state: str) -> None:
    assert bench.go(after_ms, valid=False).state == state
    if state != "following":
        assert "the tracker calls it lost" in bench.last.reason
    assert bench.last.target is not None
    again = bench.go(300)
    assert again.state == ("idle" if state == "idle" else "following")
    if state == "idle":
        assert "press it again" in again.reason
        bench.take_hold()


@pytest.mark.parametrize(
    ("after_ms", "state"),
    [(90, "following"), (120, "holding"), (290, "holding"), (320, "idle"), (990, "idle"), (1020, "stopped")],
)
@pytest.mark.parametrize("subject", ["tracker", "link"])
def test_silence_of_tracker_or_arm(bench: Bench, subject: str, after_ms: int, state: str) -> None:
    setattr(bench, subject, False)
    assert bench.go(after_ms).state == state, bench.last.reason
    assert (bench.last.target is None) == (state == "stopped")
    setattr(bench, subject, True)
    again = bench.go(200)
    assert again.state == {"holding": "following"}.get(state, state)


def test_silence_stops_nothing_before_anybody_takes_hold_or_once_the_hold_is_over() -> None:
    bench = Bench()
    bench.tracker = False
    assert bench.go(5000).state == "idle"
    bench = Bench().take_hold()
    bench.tracker = False
    bench.go(500)
    bench.clutch = False
    assert bench.go(3000).state == "idle"


def test_silence_freezes_the_target_at_the_measured_pose() -> None:
    bench = Bench(LimitSettings()).take_hold()
    bench.stuck = True
    bench.go(1000, move=(0.1, 0, 0))
    assert bench.last.target is not None
    assert np.linalg.norm(bench.last.target.position_m - MIDDLE) == pytest.approx(0.03, abs=1e-4)
    bench.tracker = False
    assert bench.go(110).state == "holding"
    assert bench.go(600).state == "idle"
    assert bench.last.target is not None
    np.testing.assert_allclose(bench.last.target.position_m, MIDDLE, atol=1e-4)


def test_a_target_comes_after_an_arm_that_is_pushed_away_but_stays_in_the_box() -> None:
    bench = Bench(LimitSettings()).take_hold()
    bench.clutch = False
    bench.go(50)
    bench.stuck, bench.arm = True, Pose(MIDDLE + np.array([0.1, 0.1, 0]), FORWARD)
    target = bench.go(2000).target
    assert target is not None
    assert np.linalg.norm(target.position_m - bench.arm.position_m) == pytest.approx(0.03, abs=1e-4)
    bench.arm = Pose(np.array([0.8, 0.2, 0.3]), FORWARD)  # 10 cm out of the box
    target = bench.go(3000).target
    assert target is not None
    near_m = 0.2 - 0.03 * 0.2 / math.hypot(0.3, 0.2)
    np.testing.assert_allclose(target.position_m, [0.7, near_m, 0.3], atol=1e-4)


@pytest.mark.parametrize(
    ("away_ms", "state"), [(90, "following"), (150, "holding"), (400, "idle"), (3000, "idle")]
)
def test_a_loop_that_was_away_does_not_lurch(bench: Bench, away_ms: int, state: str) -> None:
    bench.go(300, move=(0.06, 0, 0))
    before, speed = bench.arm, np.linalg.norm(bench.last.velocity_m_s)
    bench.go(away_ms, dt_ms=away_ms)
    assert bench.last.state == state
    if state != "following":
        assert f"away for {away_ms} ms" in bench.last.reason
        route = np.linalg.norm(bench.arm.position_m - before.position_m)
        assert route == pytest.approx(speed**2 / 2 / bench.limits.acceleration_m_s2)
        assert not bench.last.velocity_m_s.any()


def test_a_clock_that_goes_back_lets_go_and_is_recovered_from(bench: Bench) -> None:
    bench.now_ns -= 5000 * MS
    assert bench.go(10).state == "idle"
    assert "the clock went back" in bench.last.reason
    assert bench.go(500).state == "idle"
    bench.take_hold()


def test_after_a_stop_a_person_has_to_allow_it_and_it_begins_at_the_measured_pose(bench: Bench) -> None:
    bench.chain.stop("a reflex of the arm")
    assert bench.go(100).target is None
    assert (bench.last.state, bench.last.reason) == ("stopped", "a reflex of the arm")
    bench.clutch = False
    bench.go(50)
    bench.clutch = True
    assert bench.go(50).state == "stopped"
    bench.chain.clear()
    bench.arm = Pose(MIDDLE - 0.1, FORWARD)
    assert bench.go(50).state == "idle"
    bench.take_hold()
    assert bench.away_m == [-0.1, -0.1, -0.1]


def test_it_cannot_begin_outside_of_the_workspace() -> None:
    bench = Bench()
    bench.arm = Pose(MIDDLE + np.array([0.212, 0, 0]), FORWARD)
    bench.clutch = False
    bench.go(20)
    bench.clutch = True
    assert bench.go(50).target is None
    assert bench.last.reason == "the hand is 12 mm outside of the workspace along x; guide it back"
    bench.arm = Pose(MIDDLE, so3.IDENTITY)
    assert bench.go(50).target is None
    assert "leans 33° too far" in bench.last.reason
    bench.arm = Pose(MIDDLE, FORWARD)
    assert bench.go(50).state == "following"


def test_settings_that_make_no_sense_are_refused() -> None:
    with pytest.raises(InvalidValueError, match="speed_m_s"):
        ArmChain(ArmSettings(limits=LimitSettings(speed_m_s=5.0)))
    with pytest.raises(InvalidValueError, match="workspace's y"):
        LimitSettings(low_m=(0.3, 0.5, 0))
    with pytest.raises(InvalidValueError, match="no direction"):
        LimitSettings(upright=(0, 0, 0))
    with pytest.raises(InvalidValueError, match="order"):
        WatchdogSettings(hold_ms=500)
    changes: dict[str, Any] = {"frame": "openxr", "yaw_rad": 0.1, "base_yaw_rad": 0.1, "scale": 0.5}
    changes |= {"mirror": True, "gain_xyz": (1.0, 0.0, 1.0), "gain_turn": (0.0, 1.0, 1.0), "forearm": "left"}
    for key, value in changes.items():
        with pytest.raises(InvalidValueError, match="absolute poses are in the base's axes"):
            MappingSettings(**{"frame": "base", "absolute": True, key: value})
