"""The loop's waits, on a clock that is set by hand and a bell that counts."""

from __future__ import annotations

from typing import Any

from hypothesis import given
from hypothesis import strategies as st

from tega.loop.pacing import Pacer
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


@given(st.integers(0, 50 * MS), st.integers(1, 100 * MS))
def test_the_bell_is_waited_for_up_to_the_deadline_and_no_longer(elapsed_ns: int, left_ns: int) -> None:
    clock = ManualClock()
    bell: Any = CountingBell(clock, None)
    pacer = Pacer(clock, bell=bell)
    pacer.start()
    clock.sleep_until(clock.now_ns() + elapsed_ns)
    assert pacer.doze(elapsed_ns + left_ns) == elapsed_ns + left_ns
    (waited_s,) = bell.waits_s
    assert round(waited_s * 1e9) == left_ns


@given(st.integers(1, 20 * MS), st.integers(1, 20 * MS))
def test_a_ring_before_the_deadline_is_a_turn_of_its_own_and_a_late_one_is_kept(
    rings_ns: int, due_ns: int
) -> None:
    clock = ManualClock()
    bell: Any = CountingBell(clock, rings_ns)
    pacer = Pacer(clock, bell=bell)
    pacer.start()
    woken_ns = pacer.doze(due_ns)
    if rings_ns < due_ns:
        assert (woken_ns, pacer.tick_ns, bell.n_rung) == (rings_ns, rings_ns, 0)
    else:
        assert (woken_ns, bell.n_rung) == (due_ns, 1)
