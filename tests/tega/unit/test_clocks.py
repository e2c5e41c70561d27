"""The loop's waits, a time of day that is set during a run, and what runs in threads beside a loop."""

from __future__ import annotations

import threading
import time
from collections import defaultdict
from itertools import pairwise
from unittest.mock import Mock

import pytest
from hypothesis import given
from hypothesis import strategies as st

from reference.processes import until
from tega.loop.pacing import Pacer
from tega.loop.rig import ClockStep
from tega.recording.pictures import compute_ahead
from tega.runtime.clock import ManualClock, every

MS = 1_000_000


def paced(rings_after_ns: int | None) -> tuple[Pacer, ManualClock, Mock]:
    clock, bell = ManualClock(), Mock()

    def wait(_timeout_s: float) -> bool:
        if rings_after_ns is not None:
            clock.sleep_until(clock.now_ns() + rings_after_ns)
        return rings_after_ns is not None

    bell.wait.side_effect = wait
    pacer = Pacer(clock, bell=bell)
    pacer.start()
    return pacer, clock, bell


@given(st.integers(0, 50 * MS), st.integers(1, 100 * MS))
def test_the_bell_is_waited_for_up_to_the_deadline_and_no_longer(elapsed_ns: int, left_ns: int) -> None:
    pacer, clock, bell = paced(None)
    clock.sleep_until(clock.now_ns() + elapsed_ns)
    assert pacer.doze(elapsed_ns + left_ns) == elapsed_ns + left_ns
    assert [round(call.args[0] * 1e9) for call in bell.wait.call_args_list] == [left_ns]


@given(st.integers(1, 20 * MS), st.integers(1, 20 * MS))
def test_a_ring_before_the_deadline_is_a_turn_of_its_own_and_a_late_one_is_kept(
    rings_ns: int, due_ns: int
) -> None:
    pacer, _, bell = paced(rings_ns)
    woken_ns = pacer.doze(due_ns)
    if rings_ns < due_ns:
        assert (woken_ns, pacer.tick_ns, bell.ring.call_count) == (rings_ns, rings_ns, 0)
    else:
        assert (woken_ns, bell.ring.call_count) == (due_ns, 1)


class Clocks:
    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.day_ns, self.run_ns = 1_700_000_000_000 * MS, 5_000_000 * MS
        monkeypatch.setattr(time, "time_ns", lambda: self.day_ns)
        monkeypatch.setattr(time, "monotonic_ns", lambda: self.run_ns)

    def go(self, seconds: float, *, jump_s: float = 0.0) -> None:
        self.run_ns += round(seconds * 1000 * MS)
        self.day_ns += round((seconds + jump_s) * 1000 * MS)


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
        for later_s, still in ((4.9, text), (0.2, ""), (3600.0, "")):
            clocks.go(later_s)
            assert step() == still
        for second_s in (60.0, -2.0):  # each counts from the one before
            clocks.go(1.0, jump_s=second_s)
            assert f"{second_s:+.1f} s" in step()


@given(st.lists(st.floats(-0.49, 0.49), max_size=10))
def test_slewing_is_no_jump(slews_s: list[float]) -> None:
    with pytest.MonkeyPatch.context() as monkeypatch:
        clocks = Clocks(monkeypatch)
        step = ClockStep()
        for before_s, after_s in pairwise([0.0, *slews_s]):  # an offset that stays within half a second
            clocks.go(1.0, jump_s=after_s - before_s)
            assert step() == ""


def test_calls_go_on_in_another_thread_that_ends_with_the_block() -> None:
    seen = list[threading.Thread]()
    with every(lambda: seen.append(threading.current_thread()), every_s=0.001):
        until(lambda: len(seen) > 3)
    n_seen = len(seen)
    (ours,) = set(seen)
    assert ours is not threading.current_thread()
    assert not ours.is_alive()
    time.sleep(0.01)
    assert len(seen) == n_seen


def test_a_block_ends_when_its_call_has_returned() -> None:
    begun, may_end, returned = threading.Event(), threading.Event(), []

    def call() -> None:
        begun.set()
        may_end.wait(5.0)
        returned.append(True)

    with every(call, every_s=60.0):
        assert begun.wait(5.0)
        may_end.set()
    assert returned == [True]


@pytest.mark.filterwarnings("ignore::pytest.PytestUnhandledThreadExceptionWarning")
@pytest.mark.parametrize("error", [ValueError, BaseException])  # a panic of native code is no Exception
def test_one_that_fails_is_the_last_of_its_function_alone(error: type[BaseException]) -> None:
    n_failed, n_called = [], []

    def fail() -> None:
        n_failed.append(1)
        raise error("told as a thread's end is")

    with every(fail, every_s=0.001), every(lambda: n_called.append(1), every_s=0.001):
        until(lambda: bool(n_failed))
        n_called.clear()
        until(lambda: len(n_called) > 3)
    assert len(n_failed) == 1


def test_every_item_comes_in_order_with_its_result_and_those_of_one_name_are_computed_in_order() -> None:
    computed: defaultdict[int, list[int]] = defaultdict(list)

    def compute(number: int) -> int:
        if number % 7 == 0:
            time.sleep(0.001)  # the next batch would overtake this one
        computed[number % 3].append(number)
        return -number

    found = [*compute_ahead(range(300), lambda number: str(number % 3).strip("0"), compute)]
    assert found == [(number, -number if number % 3 else None) for number in range(300)]
    assert computed == {name: [*range(name, 300, 3)] for name in (1, 2)}


def test_an_error_is_raised_once_its_item_is_next() -> None:
    ahead = compute_ahead(range(100), lambda _: "a", lambda number: 1 / (number - 5))
    assert [next(ahead)[0] for _ in range(5)] == [0, 1, 2, 3, 4]
    with pytest.raises(ZeroDivisionError):
        next(ahead)


@pytest.mark.parametrize(("name", "most"), [("a", 65), ("", 1)])
def test_what_is_read_stays_bounded(name: str, most: int) -> None:
    numbers = iter(range(1000))
    next(compute_ahead(numbers, lambda _: name, lambda number: number))
    assert next(numbers) <= most
