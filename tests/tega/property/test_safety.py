"""What must hold whatever happens: states, the guard, motors of the vest, commands to the hand."""

from __future__ import annotations

import math
import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from reference.hand import HELLO, stuck_hand
from reference.vest_bench import KeptVest
from tega.devices.vest.vest_stream import VestOptions
from tega.hand import TORQUE_LIMITS, HandController
from tega.hand.link import HandLink, Received
from tega.haptics import LAYOUTS, MotorLevels
from tega.haptics.motor_layout import SHIPPED
from tega.loop.inbox.sources import SourceReport
from tega.safety.guard import Guard, Watched
from tega.safety.motor_budget import HEAT_TAU_S, MotorBudget
from tega.safety.states import RunStates, SafetySection, Transition

MS = 1_000_000
# Mostly nothing is wrong: else hardly any sequence gets far.
NAMES = st.one_of(
    st.just(frozenset[str]()),
    st.just(frozenset[str]()),
    st.frozensets(st.sampled_from(["emg", "thumb", "vest", "calibration"])),
)
# A moment: time since the one before it, what is wrong, what holds, whether to go, whether to stop.
MOMENTS = st.lists(
    st.tuples(
        st.integers(0, 500),
        NAMES,
        NAMES,
        st.sampled_from([True, True, False]),
        st.integers(0, 9).map(lambda n: n == 9),
    ),
    max_size=40,
)


@settings(max_examples=120)
@given(moments=MOMENTS, settle_ms=st.sampled_from([0, 0, 200]), give_up_ms=st.none() | st.integers(0, 1000))
def test_no_sequence_of_events_leads_to_active_without_every_condition(moments, settle_ms, give_up_ms):
    changes: list[Transition] = []
    give_up_ns = None if give_up_ms is None else give_up_ms * MS
    run = RunStates(settle_ns=settle_ms * MS, give_up_ns=give_up_ns, on_change=changes.append)
    t_ns, clear_since, stopped, armed = 0, None, False, False
    for wait_ms, wrong, holding, go, stop in moments:
        t_ns += wait_ms * MS
        before, n_before = run.state, len(changes)
        if stop:
            run.stop(t_ns, "asked to")
            stopped = True
            assert run.state == "stopped"
            continue
        clear = not wrong and not holding
        clear_since = (t_ns if clear_since is None else clear_since) if clear else None
        settled = clear_since is not None and t_ns - clear_since >= settle_ms * MS
        named = {name: name for name in wrong}
        state = run.check(t_ns, wrong=named, holding={name: name for name in holding}, go=go)
        armed = armed or "armed" in [change.state for change in changes]
        assert (state == "stopped") == stopped
        entered = [change.state for change in changes[n_before:]]
        if "active" in entered:
            assert settled or (before == "armed" and clear)
            assert before == "hold" or (armed and go)
        if state == "active":
            assert not holding
        if state == "hold" and before != "hold":
            assert before == "active"
        assert run.reason
    for first, second in zip(["idle", *(c.state for c in changes)], changes, strict=False):
        assert (first, second.state) in {
            ("idle", "armed"), ("armed", "idle"), ("armed", "active"), ("active", "hold"), ("hold", "active"),
            ("hold", "idle"), *((s, "stopped") for s in ("idle", "armed", "active", "hold")),
        }  # fmt: skip


@given(moments=MOMENTS, levels=st.lists(st.integers(1, 5), min_size=40, max_size=40))
def test_only_an_active_run_passes_a_level_on(moments: list[Any], levels: list[int]) -> None:
    guard = Guard()
    states = guard._states
    t_ns, last = 0, 1
    for (wait_ms, wrong, holding, go, stop), level in zip(moments, levels, strict=False):
        t_ns += wait_ms * MS
        if stop:
            guard.stop(t_ns, "asked to")
        states.check(t_ns, wrong=dict.fromkeys(wrong, "x"), holding=dict.fromkeys(holding, "x"), go=go)
        reported = guard.level(level)
        last = level if guard.state == "active" else last if guard.state == "hold" else 1
        assert reported == last
        assert guard.felt == (guard.state in {"active", "hold"})


def active(begin_ms: int = 0, **more: Any) -> tuple[Guard, SourceReport]:
    # EMG at ten blocks a second; active after two seconds.
    report = SourceReport()
    guard = Guard(SafetySection(), streams=[Watched("emg", "emg", 10.0, report)], **more)
    for k in range(21):
        show(guard, begin_ms + 100 * k)
    return guard, report


def show(guard: Guard, t_ms: int, *, block_ms: int | None = None, **more: Any) -> None:
    stamp = t_ms if block_ms is None else block_ms
    guard.check(t_ms * MS, late_ns=0, stamps={"emg": stamp * MS}, counts={"emg": stamp // 100}, **more)


@pytest.mark.parametrize("begin_ms", [0, 12_300])
def test_it_arms_once_the_rate_is_known_and_nothing_was_wrong_for_a_while(begin_ms: int) -> None:
    guard, _ = active(begin_ms)
    assert [change.state for change in guard.changes] == ["armed", "active"]
    # The window of the rate, and nothing wrong.
    assert guard.changes[0].t_ns == (begin_ms + 400 + 200) * MS


def test_whatever_is_wanted_the_hand_is_between_open_and_closed_and_open_until_it_is_active() -> None:
    guard, _ = active()
    assert [guard.level(wanted) for wanted in (0.2, 1.5, 7.0, math.nan)] == [1, 1.5, 5, 1]
    guard, _ = active(go=lambda: False)
    assert (guard.state, guard.level(5), guard.felt) == ("armed", 1, False)


def test_a_fault_of_every_channel_holds_the_level_before_it_and_says_why() -> None:
    guard, report = active()
    assert guard.level(3) == 3
    # Made of samples in which the fault had begun.
    assert guard.level(5) == 5
    report.faults = ("ch1: mostly 50 Hz mains", "ch2: stays at 187500")
    show(guard, 2100, unvoted=3)
    assert guard.reason == "emg: no channel can be believed: ch1: mostly 50 Hz mains; ch2: stays at 187500"
    show(guard, 2200, unvoted=5)  # no tick of the hand
    assert (guard.level(1), guard.summary()["held_ticks"]) == (3, 1)


def test_a_short_return_does_not_end_a_hold() -> None:
    guard, _ = active()
    for t_ms in (2300, 2310, 2320, 2400, 2500, 2600):
        show(guard, t_ms, block_ms=2000 if t_ms in {2300, 2320} else None)
    # Two hundred milliseconds after the block that stayed.
    assert [(c.t_ns // MS, c.state) for c in guard.changes][2:] == [(2300, "hold"), (2600, "active")]


def test_other_alerts_are_told_and_kept_for_the_summary() -> None:
    text = ""
    guard, _ = active(alerts={"disk": lambda: text})
    assert not guard.alerts
    for t_ms, text in ((2100, "disk: full"), (2200, "")):
        show(guard, t_ms)
        assert guard.alerts == ({"disk": text} if text else {})
    assert guard.summary()["alerts"][-1] == "disk: full"
    assert guard.state == "active"


def test_calibration_that_does_not_fit_keeps_it_from_arming() -> None:
    guard, _ = active(calibration=lambda: "calibration: of another person")
    assert (guard.state, guard.reason) == ("idle", "calibration: of another person")


def test_a_stream_at_a_fifth_of_its_rate_keeps_it_from_arming_and_is_named_with_its_number() -> None:
    guard = Guard(SafetySection(), streams=[Watched("emg", "emg", 10.0, SourceReport())])
    for k in range(60):
        guard.check(100 * k * MS, late_ns=0, stamps={"emg": 100 * k * MS}, counts={"emg": 7 + k // 5})
    assert (guard.state, guard.reason) == ("idle", "emg: 2.0 a second come, 10 are expected")


frames = st.just(100) | st.integers(0, 100) | hnp.arrays(np.uint8, 40, elements=st.integers(0, 255))
drives = st.lists(st.tuples(st.floats(0, 30), frames, st.sampled_from([1, 1, 40])), min_size=1, max_size=40)


@given(drive=drives, limit=st.integers(1, 100), heat=st.floats(0.01, 1), dose_s=st.floats(10, 20))
@example(
    drive=[(1.0, 100, 40), (0.1, 100, 40)], limit=100, heat=0.3, dose_s=20.0
)  # full drive for 40 s, then often
@example(drive=[(1.0, 100, 40)], limit=100, heat=0.05, dose_s=20.0)  # heat ends it long before the dose does
def test_no_input_drives_a_motor_beyond_ceiling_heat_or_dose(drive, limit, heat, dose_s) -> None:
    budget = MotorBudget(limit=limit, heat_share=heat, dose_s=dose_s)
    assert {one.shape for one in (budget.heat, budget.dose_s, budget.carried_s)} == {(40,)}
    t_s = 0.0
    for wait_s, wanted in [(wait_s, wanted) for wait_s, wanted, n in drive for _ in range(n)]:
        t_s += wait_s
        requested = np.full(40, wanted, np.uint8) if isinstance(wanted, int) else wanted
        displayed = budget.allow(round(t_s * 1e9), requested)
        assert displayed.dtype == np.uint8
        assert (displayed <= np.minimum(requested, limit)).all()
        assert (budget.heat <= heat + 1e-12).all()
        assert (budget.dose_s <= dose_s).all()


def test_full_drive_from_cold_ends_at_what_can_be_kept_and_then_at_nothing() -> None:
    budget = MotorBudget(heat_share=0.5, dose_s=100.0)
    full = np.full(40, 100, np.uint8)
    course = [int(budget.allow(round(k * 1e8), full)[0]) for k in range(4000)]
    until_s = course.index(next(c for c in course if c < 100)) / 10
    # θ reaches 0.4, from where the ceiling sinks, after -τ ln 0.6.
    assert until_s == pytest.approx(-HEAT_TAU_S * np.log(0.6), abs=0.2)
    assert budget.heat[0] < 0.5
    assert course[-1] <= 10
    assert 90 < budget.dose_s[0] <= 100
    assert "dose of 40 motors" in budget.words()[0]


@st.composite
def levels_of_any_layout(draw: st.DrawFn) -> MotorLevels:
    layout = draw(st.sampled_from(LAYOUTS))
    motors = hnp.arrays(np.uint8, len(SHIPPED[layout].motors), elements=st.integers(0, 100))
    return MotorLevels(layout, draw(motors))


@settings(max_examples=15)
@given(frames=st.lists(levels_of_any_layout(), max_size=8), limit=st.integers(1, 100))
def test_a_driver_s_link_is_never_told_more_than_the_limit(frames: list[MotorLevels], limit: int) -> None:
    vest = KeptVest(VestOptions(limit=limit))
    with vest:
        for frame in frames:
            displayed = vest.write(0, frame)
            assert displayed.layout == frame.layout
            assert (displayed.intensities <= np.minimum(frame.intensities, limit)).all()
    assert vest.wire.sent
    assert all((sent <= limit).all() for _, sent in vest.wire.sent)
    assert not vest.wire.sent[-1][1].any()


received = st.one_of(
    # Positions of a finger: any angle counts.
    st.builds(
        lambda finger, words: Received(0x80 + 4 * finger, struct.pack("<4h", *words)),
        st.integers(0, 3),
        st.tuples(*[st.integers(-32768, 32767)] * 4),
    ),
    st.builds(Received, st.integers(0, 0x7FF), st.binary(max_size=8), st.booleans()),
    # What lets it begin: the answer to the request for its version.
    st.just(HELLO),
)


@settings(max_examples=25)
@given(
    steps=st.lists(
        st.tuples(st.lists(received, max_size=5), st.integers(0, 40), st.integers(1, 5)), max_size=60
    ),
    steady=st.sampled_from([0, 30, 600, 1500]),
    share=st.sampled_from([0.02, 0.2, 1.0]),
)
def test_no_frames_of_a_hand_lead_to_a_torque_beyond_its_limits(steps, steady, share) -> None:
    link = HandLink(HandController(torque_limits=TORQUE_LIMITS * share))
    limits = np.round(np.minimum(TORQUE_LIMITS * share, 1.0) * 1200) + 1
    t_ns, pushed = 0, False

    # First a hand with something in its way, so that the torque rises to what is allowed; then anything.
    begin = [(stuck_hand(k), 3, 5) for k in range(steady)]
    for frames, wait_ms, level in [*begin, *steps]:
        t_ns += wait_ms * MS
        for frame in link.exchange(frames, t_ns, level, wait_ms % 5 / 4):  # and anything may be added
            if frame.id >> 2 in range(0x60, 0x64) and not frame.remote:
                finger = (frame.id >> 2) - 0x60
                duties = np.array(struct.unpack("<4h", frame.data))
                assert (np.abs(duties) <= limits[4 * finger : 4 * finger + 4]).all()
                pushed = pushed or bool(duties.any())
    assert pushed or steady < 600
    assert (np.abs(link._link.torques) <= TORQUE_LIMITS * share + 1e-12).all()
    for frame in link.abandon():
        assert not any(frame.data[:8]) or frame.id >> 2 not in range(0x60, 0x64)
