"""What the guard makes of what it is shown, with time as a number."""

from __future__ import annotations

import math
from typing import Any

import pytest

from tega.loop.inbox.sources import SourceReport
from tega.safety.guard import Guard, Watched
from tega.safety.states import SafetySection
from tega.safety.stop import Stop

MS = 1_000_000


def active(begin_ms: int = 0, **more: Any) -> tuple[Guard, SourceReport]:
    """A guard of EMG at ten blocks a second that has become active after two seconds."""
    report = SourceReport()
    guard = Guard(SafetySection(), streams=[Watched("emg", "emg", 10.0, report)], **more)
    for k in range(21):
        show(guard, begin_ms + 100 * k)
    return guard, report


def show(guard: Guard, t_ms: int, *, block_ms: int | None = None, **more: Any) -> None:
    """Show it a moment at which the newest block is so old."""
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
    assert guard.level(1) == 3


def test_a_block_that_is_late_by_less_than_allowed_changes_nothing() -> None:
    guard, _ = active()
    show(guard, 2249, block_ms=2000)
    assert guard.changes[-1].state == "active"
    show(guard, 2251, block_ms=2000)
    assert (guard.state, guard.reason) == ("hold", "emg: no signal for 0.3 s")


def test_a_short_return_does_not_end_a_hold() -> None:
    guard, _ = active()
    show(guard, 2300, block_ms=2000)
    show(guard, 2310)
    show(guard, 2320, block_ms=2000)
    show(guard, 2400)
    show(guard, 2500)
    show(guard, 2600)
    # Two hundred milliseconds after the block that stayed.
    assert [(c.t_ns // MS, c.state) for c in guard.changes][2:] == [(2300, "hold"), (2600, "active")]


def test_other_alerts_are_told_and_kept_for_the_summary() -> None:
    text = [""]
    guard, _ = active(alerts={"disk": lambda: text[0]})
    assert not guard.alerts
    text[0] = "disk: full"
    show(guard, 2100)
    assert guard.alerts == {"disk": "disk: full"}
    text[0] = ""
    show(guard, 2200)
    assert not guard.alerts
    assert guard.summary()["alerts"][-1] == "disk: full"
    assert guard.state == "active"


def test_calibration_that_does_not_fit_keeps_it_from_arming() -> None:
    guard, _ = active(calibration=lambda: "calibration: of another person")
    assert (guard.state, guard.reason) == ("idle", "calibration: of another person")


def test_the_first_reason_to_stop_counts() -> None:
    stop, pedal = Stop(), [""]
    stop.also(lambda: pedal[0])
    assert not stop()
    pedal[0] = "the pedal"
    assert stop()
    stop.ask("Ctrl-C")
    assert stop.reason == "the pedal"


def test_a_stream_at_a_fifth_of_its_rate_keeps_it_from_arming_and_is_named_with_its_number() -> None:
    guard = Guard(SafetySection(), streams=[Watched("emg", "emg", 10.0, SourceReport())])
    for k in range(60):
        t_ms = 100 * k
        guard.check(t_ms * MS, late_ns=0, stamps={"emg": t_ms * MS}, counts={"emg": 7 + k // 5})
    assert guard.state == "idle"
    assert guard.reason == "emg: 2.0 a second come, 10 are expected"
