"""What runs beside a loop: calls at intervals have a thread each; results that are computed ahead come in order."""

from __future__ import annotations

import threading
import time
from collections import defaultdict
from collections.abc import Iterator

import pytest

from reference.processes import until
from tega.recording.pictures import compute_ahead
from tega.runtime.clock import every


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

    found = list(
        compute_ahead(range(300), lambda number: "" if number % 3 == 0 else str(number % 3), compute)
    )
    assert found == [(number, -number if number % 3 else None) for number in range(300)]
    assert computed == {name: [*range(name, 300, 3)] for name in (1, 2)}


def test_an_error_is_raised_once_its_item_is_next() -> None:
    def compute(number: int) -> float:
        return 1 / (number - 5)

    ahead = compute_ahead(range(100), lambda _: "a", compute)
    assert [next(ahead)[0] for _ in range(5)] == [0, 1, 2, 3, 4]
    with pytest.raises(ZeroDivisionError):
        next(ahead)


@pytest.mark.parametrize(("name", "most"), [("a", 65), ("", 1)])
def test_what_is_read_stays_bounded(name: str, most: int) -> None:
    n_read = 0

    def numbers() -> Iterator[int]:
        nonlocal n_read
        for number in range(1000):
            n_read += 1
            yield number

    ahead = compute_ahead(numbers(), lambda _: name, lambda number: number)
    next(ahead)
    assert n_read <= most
