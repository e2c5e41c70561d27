"""The loop's waits, a time of day that is set during a run, and the Lab Streaming Layer's clock against ours."""

from __future__ import annotations

import time
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from tega.loop.pacing import Pacer
from tega.loop.rig import ClockStep
from tega.runtime.clock import ManualClock

MS = 1_000_000


class CountingBell:
    """Bell that keeps how long it was waited for, and is rung after a part of it."""

    def __init__(self, clock: Any, rings_after_ns: int | None) -> None:
        self.waits_s: list[float] = []
        self.n_rung = 0
        self._clock, self._rings_after_ns = clock, rings_after_ns

    def wait(self, timeout_s: float) -> bool:
        self.waits_s.append(timeout_s)
        if self._rings_after_ns is None:
            return False
        self._clock.sleep_until(self._clock.now_ns() + self._rings_after_ns)
        return True

    def ring(self) -> None:
        self.n_rung += 1


def paced(rings_after_ns: int | None) -> tuple[Pacer, ManualClock, Any]:
    """Return a pacer that has begun, its clock and its bell."""
    clock = ManualClock()
    bell: Any = CountingBell(clock, rings_after_ns)
    pacer = Pacer(clock, bell=bell)
    pacer.start()
    return pacer, clock, bell


@given(st.integers(0, 50 * MS), st.integers(1, 100 * MS))
def test_the_bell_is_waited_for_up_to_the_deadline_and_no_longer(elapsed_ns: int, left_ns: int) -> None:
    pacer, clock, bell = paced(None)
    clock.sleep_until(clock.now_ns() + elapsed_ns)
    assert pacer.doze(elapsed_ns + left_ns) == elapsed_ns + left_ns
    (waited_s,) = bell.waits_s
    assert round(waited_s * 1e9) == left_ns


@given(st.integers(1, 20 * MS), st.integers(1, 20 * MS))
def test_a_ring_before_the_deadline_is_a_turn_of_its_own_and_a_late_one_is_kept(
    rings_ns: int, due_ns: int
) -> None:
    pacer, _, bell = paced(rings_ns)
    woken_ns = pacer.doze(due_ns)
    if rings_ns < due_ns:
        assert (woken_ns, pacer.tick_ns, bell.n_rung) == (rings_ns, rings_ns, 0)
    else:
        assert (woken_ns, bell.n_rung) == (due_ns, 1)


S = 1_000_000_000


class Clocks:
    """Both clocks of the machine, set by hand."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.day_ns, self.run_ns = 1_700_000_000 * S, 5_000 * S
        monkeypatch.setattr(time, "time_ns", lambda: self.day_ns)
        monkeypatch.setattr(time, "monotonic_ns", lambda: self.run_ns)

    def go(self, seconds: float, *, jump_s: float = 0.0) -> None:
        self.run_ns += round(seconds * S)
        self.day_ns += round((seconds + jump_s) * S)


@given(st.floats(0.51, 1e6), st.booleans())
def test_a_jump_is_reported_with_its_size_and_sign_for_five_seconds(size_s: float, back: bool) -> None:
    with pytest.MonkeyPatch.context() as monkeypatch:
        clocks = Clocks(monkeypatch)
        step = ClockStep()
        assert step() == ""
        jump_s = -size_s if back else size_s
        clocks.go(1.0, jump_s=jump_s)
        text = step()
        assert f"jumped by {jump_s:+.1f} s" in text
        clocks.go(4.9)
        assert step() == text
        clocks.go(0.2)
        assert step() == ""
        clocks.go(3600.0)
        assert step() == ""


@given(st.lists(st.floats(-0.49, 0.49), max_size=10))
def test_slewing_is_no_jump(slews_s: list[float]) -> None:
    with pytest.MonkeyPatch.context() as monkeypatch:
        clocks = Clocks(monkeypatch)
        step = ClockStep()
        at_s = 0.0
        for slew_s in slews_s:
            clocks.go(1.0, jump_s=slew_s - at_s)  # an offset that stays within half a second
            at_s = slew_s
            assert step() == ""


def test_a_second_jump_counts_from_the_first(monkeypatch: pytest.MonkeyPatch) -> None:
    clocks = Clocks(monkeypatch)
    step = ClockStep()
    clocks.go(1.0, jump_s=60.0)
    assert "+60.0 s" in step()
    clocks.go(1.0, jump_s=-2.0)
    assert "-2.0 s" in step()
