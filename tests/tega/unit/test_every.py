"""Calls at intervals share a thread, and none outlives the block that it was made for."""

from __future__ import annotations

import threading

import pytest

from reference.waiting import until
from tega.runtime.clock import every


def test_calls_of_all_blocks_come_from_one_thread_that_ends_with_the_last() -> None:
    seen: dict[str, set[int]] = {"first": set(), "second": set()}

    def note(name: str) -> None:
        seen[name].add(threading.get_ident())

    with every(lambda: note("first"), every_s=0.001):
        with every(lambda: note("second"), every_s=0.001):
            until(lambda: all(seen.values()))
        seen["second"].clear()
        seen["first"].clear()
        until(lambda: bool(seen["first"]))
        assert not seen["second"]
        (ours,) = (thread for thread in threading.enumerate() if thread.name == "tega-every")
        assert seen["first"] == {ours.ident}
    ours.join(5.0)
    assert not ours.is_alive()


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
