"""The arm's chain against exact references, and what must hold for any input at any rate."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest
from hypothesis import event, given, settings
from hypothesis import strategies as st

from reference.arm import Obedience, quaternions, turn_between, vectors
from reference.arm_bench import FORWARD, MIDDLE, Bench
from tega.arm import (
    ArmChain,
    ArmCommand,
    ArmSettings,
    FilterSettings,
    GateSettings,
    LimitSettings,
    MappingSettings,
    Pose,
    StampedPose,
)
from tega.arm import rotation as so3
from tega.arm.motion import Follower
from tega.arm.workspace import Workspace

BASE = MappingSettings(frame="base")


limit_sets = st.builds(
    LimitSettings,
    tilt_rad=st.sampled_from([0.1, 1.0, 1.5]),
    speed_m_s=st.sampled_from([0.05, 0.25, 1.7]),
    acceleration_m_s2=st.sampled_from([0.2, 2.0, 13.0]),
    turn_rad_s=st.sampled_from([0.2, 1.0, 2.5]),
    turn_acceleration_rad_s2=st.sampled_from([0.5, 6.0, 25.0]),
    ahead_m=st.sampled_from([0.005, 0.03, 10.0]),
    ahead_rad=st.sampled_from([0.02, 0.2, 3.0]),
)


@given(
    limits=limit_sets,
    goals=st.lists(st.tuples(vectors, quaternions, st.integers(1, 30)), min_size=1, max_size=6),
    dt_s=st.sampled_from([0.001, 0.01, 0.02, 0.1]),
)
@settings(max_examples=settings().max_examples // 4)
def test_a_follower_obeys_and_arrives(limits, goals, dt_s) -> None:
    workspace = Workspace(limits)
    follower = Follower(limits, workspace, Pose(MIDDLE, FORWARD))
    obedience, t_ns = Obedience(limits), 0
    dt_ns = round(dt_s * 1e9)

    def tick(goal: Pose) -> None:
        nonlocal t_ns
        t_ns += dt_ns
        follower.step(goal, dt_s)
        zero = np.zeros(3)
        obedience.observe(ArmCommand(t_ns, "following", "", follower.pose, zero, zero, 1))

    for place, q, n in goals:
        goal = workspace.inside(Pose(MIDDLE + 0.6 * place, q))
        for _ in range(n):
            tick(goal)
    # A time that is long enough: there, with both limits, and twice that for what was left of the way before.
    farthest = 1.3 / limits.speed_m_s + limits.speed_m_s / limits.acceleration_m_s2
    turning = 3 * math.pi / limits.turn_rad_s + limits.turn_rad_s / limits.turn_acceleration_rad_s2
    q = follower.resting().quaternion_xyzw
    left_rad = turn_between(q, goal.quaternion_xyzw)
    # Where the shortest turn leaves the cone, the follower slides along the cone, nearer with each tick, but later.
    straight = workspace.holds_turning(q, so3.log(so3.multiply(goal.quaternion_xyzw, so3.inverse(q))))
    for _ in range(min(300, math.ceil(2 * max(farthest, turning) / dt_s))):
        tick(goal)
    if 2 * max(farthest, turning) <= 300 * dt_s:
        np.testing.assert_allclose(follower.pose.position_m, goal.position_m, atol=1e-6)
        reached_rad = turn_between(follower.pose.quaternion_xyzw, goal.quaternion_xyzw)
        assert reached_rad < (1e-4 if straight else left_rad / 2 + 1e-4)


@given(q=quaternions, v=vectors, tilt=st.floats(0.1, 1.5))
def test_the_cone_s_closed_form_sees_what_small_steps_see(q, v, tilt) -> None:
    workspace = Workspace(LimitSettings(tilt_rad=tilt))
    worst = max(workspace.tilt_rad(so3.multiply(so3.exp(3 * v * u), q)) for u in np.linspace(0, 1, 300))
    if abs(worst - tilt) > 1e-3:
        assert workspace.holds_turning(q, 3 * v) == (worst < tilt)
    inside = workspace.inside(Pose(MIDDLE, q))
    assert workspace.holds_turn(inside.quaternion_xyzw)
    moved = turn_between(inside.quaternion_xyzw, q)
    assert moved == pytest.approx(max(0.0, workspace.tilt_rad(q) - tilt), abs=1e-7)


FAULTS = (
    "nan", "infinite", "long", "zero", "jump", "spin", "invalid", "old", "future", "fingers", "same", "back", "far",
)  # fmt: skip


def spoilt(pose: StampedPose, fault: str) -> StampedPose:
    place, q = np.array(pose.position_m), np.array(pose.quaternion_xyzw)
    match fault:
        case "nan":
            place[1] = math.nan
        case "infinite":
            q[2] = math.inf
        case "long":
            q *= 1.1
        case "zero":
            q *= 0
        case "jump":
            place += 0.5
        case "spin":
            q = so3.multiply(so3.exp(np.array([0, 0, 2.0])), q)
        case "invalid":
            return pose._replace(valid=False)
        case "old":
            return pose._replace(t_ns=pose.t_ns - 3_000_000_000)
        case "future":
            return pose._replace(t_ns=pose.t_ns + 3_000_000_000)
        case "fingers":
            place = np.zeros((26, 3))
        case "far":
            place += 1e300
        case "back":
            return pose._replace(t_ns=pose.t_ns - 1)
    return pose._replace(position_m=place, quaternion_xyzw=q)


tick = st.fixed_dictionaries(
    {
        "dt_ms": st.one_of(
            st.integers(1, 20), st.sampled_from([0, 1, 16, 50, 99, 101, 250, 1000, 3000, -1, -5000])
        ),
        "times": st.sampled_from([1, 1, 5, 30]),
        "v": vectors,
        "w": vectors,
        "faults": st.lists(st.sampled_from(FAULTS), max_size=3),
        "good": st.integers(0, 8).map(lambda n: n > 0),
        "flip": st.booleans(),
        "clutch": st.integers(0, 9).map(lambda n: n > 0),
        "dead_man": st.integers(0, 9).map(lambda n: n > 0),
        "measured": st.sampled_from(
            ["lag", "lag", "lag", "stuck", "none", "nan", "elsewhere", "old", "turned"]
        ),
        "stop": st.integers(0, 40).map(lambda n: n == 0),
        "clear": st.booleans(),
    }
)


mappings = st.one_of(
    st.sampled_from([0.3, 1.0, 1.5]).map(lambda scale: MappingSettings(frame="base", scale=scale)),
    st.just(MappingSettings(frame="base", absolute=True)),
)


@given(limits=limit_sets, ticks=st.lists(tick, min_size=3, max_size=25), mapping=mappings)
@settings(max_examples=30)
def test_no_input_leads_to_a_target_that_breaks_a_limit(limits, ticks, mapping) -> None:
    chain = ArmChain(ArmSettings(limits=limits, mapping=mapping, gate=GateSettings()))
    obedience = Obedience(limits)
    now_ns, hand, turn, arm = 10_000_000_000, np.zeros(3), so3.IDENTITY, Pose(MIDDLE, FORWARD)
    states = set()
    sound = {"dead_man": True, "dt_ms": 10, "measured": "lag", "faults": [], "good": True}
    opening = [ticks[0] | sound | {"clutch": clutch} for clutch in (False, True)]
    for step in opening + ticks:
        for _ in range(step["times"]):
            now_ns += step["dt_ms"] * 1_000_000
            hand = hand + 0.02 * step["v"]
            turn = so3.unit(so3.multiply(so3.exp(0.1 * step["w"]), turn))
            good = StampedPose(now_ns, hand, -turn if step["flip"] else turn)
            poses = [spoilt(good, fault) for fault in step["faults"]] + [good] * step["good"]
            reported = StampedPose(now_ns, *arm)
            measured: StampedPose | None = reported
            match step["measured"]:
                case "none":
                    measured = None
                case "nan":
                    measured = spoilt(reported, "nan")
                case "elsewhere":
                    measured = reported._replace(position_m=MIDDLE + step["v"])
                case "old":
                    measured = reported._replace(t_ns=now_ns - 2_000_000_000)
                case "turned":
                    measured = reported._replace(quaternion_xyzw=so3.multiply(turn, FORWARD))
            if step["stop"]:
                chain.stop("somebody stopped it")
            if step["clear"]:
                chain.clear()
            command = chain.step(
                now_ns, poses, clutch=step["clutch"], dead_man=step["dead_man"], measured=measured
            )
            obedience.observe(command)
            states.add(command.state)
            assert command.reason
            if command.target is not None and step["measured"] == "lag":
                arm = Pose(
                    arm.position_m + 0.3 * (command.target.position_m - arm.position_m),
                    command.target.quaternion_xyzw,
                )
    event("states " + " ".join(sorted(states)))
    event("moved" if obedience.moved_m > 0.01 else "hardly moved")


def follow(bench: Bench, n: int, dt_ms: int, hand: Callable[[int], Pose]) -> list[ArmCommand]:
    """Step twice with the clutch open, then so many times with a hand that goes its way."""
    out = []
    for number in range(-2, n):
        bench.clutch = number >= 0
        bench.hand_m, bench.turn = hand(max(number, 0))
        out.append(bench.go(dt_ms, dt_ms=dt_ms))
    return out


@given(
    place=vectors,
    q=quaternions,
    dt_ms=st.integers(25, 90),
    sag_m=st.floats(0, 0.025),
    scale=st.floats(0.1, 1.5),
)
@settings(max_examples=12)
def test_taking_hold_never_moves_the_target(place, q, dt_ms, sag_m, scale) -> None:
    bench, start, held = Bench(LimitSettings(), frame="openxr", scale=scale), MIDDLE + 0.1 * place, 0
    bench.arm = Pose(start, FORWARD)
    for n in range(3):  # take hold, let go, take hold elsewhere
        bench.hand_m, bench.turn = place + 0.5 * n, so3.multiply(so3.exp(0.9 * n * place), q)
        for tick_number in range(30):
            bench.clutch = tick_number > 20  # by then the tracker's jump is forgotten
            command = bench.go(dt_ms, dt_ms=dt_ms)
            held += command.state == "following"
            if command.target is not None:
                np.testing.assert_allclose(command.target.position_m, start, atol=1e-12)
                assert turn_between(command.target.quaternion_xyzw, FORWARD) < 1e-9
                # A spring sags, and is not followed down.
                bench.arm = Pose(start - np.array([0, 0, sag_m]), FORWARD)
    assert command.engagements == 3
    assert held == 27


@given(
    goals=st.lists(st.tuples(vectors, vectors), min_size=1, max_size=3),
    dt_ms=st.integers(20, 40),
    far_m=st.floats(0.1, 0.6),
)
@settings(max_examples=6)
def test_an_absolute_pose_is_reached_where_it_lies_inside_and_its_nearest_place_else(goals, dt_ms, far_m):
    bench = Bench(LimitSettings(), absolute=True)
    workspace, hand = Workspace(bench.limits), Pose(MIDDLE + 0.05 * goals[0][0], FORWARD)
    for v, w in goals:
        goal = Pose(MIDDLE + far_m * v, so3.multiply(so3.exp(0.5 * w), FORWARD))
        turn = so3.between(hand.quaternion_xyzw, goal.quaternion_xyzw)
        for number in range(8000 // dt_ms):
            share = min(1.0, number * dt_ms / 3000)  # no faster than the gate believes
            bench.hand_m = (1 - share) * hand.position_m + share * goal.position_m
            bench.turn = so3.multiply(so3.exp(share * turn), hand.quaternion_xyzw)
            bench.clutch = bench.now_ns > 20_000_000
            command = bench.go(dt_ms, dt_ms=dt_ms)
        hand, inside = goal, workspace.inside(goal)
        assert command.state == "following"
        assert command.target is not None
        np.testing.assert_allclose(command.target.position_m, inside.position_m, atol=1e-3)
        assert turn_between(command.target.quaternion_xyzw, inside.quaternion_xyzw) < 0.01


@given(v=vectors, w=vectors, dt_ms=st.integers(2, 50))
@settings(max_examples=15)
def test_q_and_minus_q_lead_to_the_same(v, w, dt_ms) -> None:
    runs = []
    for sign in (1, -1):

        def hand(n: int, sign: int = sign) -> Pose:
            return Pose(0.002 * n * v, so3.exp(0.02 * n * w) * (sign if n % 3 else 1))

        runs.append(follow(Bench(LimitSettings()), 25, dt_ms, hand)[2:])
    for one, other in zip(*runs, strict=True):
        np.testing.assert_array_equal(one.target.position_m, other.target.position_m)
        np.testing.assert_array_equal(one.target.quaternion_xyzw, other.target.quaternion_xyzw)


@given(dt_ms=st.integers(1, 120), v=vectors, w=vectors)
@settings(max_examples=20)
def test_limits_hold_at_any_rate(dt_ms, v, w) -> None:
    bench, seconds = Bench(LimitSettings()), 0.06 * dt_ms
    obedience = Obedience(bench.limits)

    def hand(n: int) -> Pose:
        phase = math.sin(2 * math.pi * n / 40)
        return Pose(min(0.08, 2 * seconds) * phase * v, so3.exp(min(0.5, 5 * seconds) * phase * w))

    for command in follow(bench, 60, dt_ms, hand):
        obedience.observe(command)
    if dt_ms <= 50:
        # A drawn hand that turns as fast as the gate's limit is taken for a tracker that jumps.
        assert command.state == "following" or "no vote: it jumped" in command.reason
    if dt_ms > 100:  # slower than the watchdog: it never begins
        assert command.target is None


@given(v=vectors, w=vectors, ahead_m=st.sampled_from([0.005, 0.03]), ahead_rad=st.sampled_from([0.05, 0.2]))
@settings(max_examples=6)
def test_the_target_stays_near_an_arm_that_is_stuck(v, w, ahead_m, ahead_rad) -> None:
    bench = Bench(LimitSettings(ahead_m=ahead_m, ahead_rad=ahead_rad, tilt_rad=1.5))
    bench.stuck = True

    def hand(n: int) -> Pose:
        swing = math.sin(n / 10)
        place = 0.3 * np.array([swing * v[0], math.cos(n / 17) * v[1], swing * v[2]])
        return Pose(place, so3.exp(0.8 * swing * w))

    for command in follow(bench, 150, 8, hand):
        if command.target is not None:
            assert np.linalg.norm(command.target.position_m - MIDDLE) <= ahead_m + 1e-6
            assert turn_between(command.target.quaternion_xyzw, FORWARD) <= ahead_rad + 1e-6


def test_a_filter_that_is_off_does_nothing() -> None:
    bench = Bench()
    bench.chain = ArmChain(ArmSettings(mapping=BASE, filter=FilterSettings(on=False)))
    ramp = follow(bench, 200, 10, lambda n: Pose(np.array([0, 0.0005 * n, 0]), so3.IDENTITY))
    assert ramp[-1].target is not None
    # The gap on a ramp is that of a tick, not that of a filter.
    assert abs(ramp[-1].target.position_m[1] - 0.0005 * 199) < 0.001
