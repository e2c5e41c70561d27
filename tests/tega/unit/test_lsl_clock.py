"""The Lab Streaming Layer's clock against ours, on a machine that does other work."""

from __future__ import annotations

import time
from types import SimpleNamespace

import pytest

from tega.runtime.lsl import to_monotonic_s


def test_a_thread_that_is_put_aside_between_two_looks_moves_no_time() -> None:
    """The library's clock is ours on Linux: a marker's time must not hang on how long two calls took."""

    def looked_at_late() -> float:
        time.sleep(0.02)
        return time.monotonic()

    assert to_monotonic_s(SimpleNamespace(local_clock=looked_at_late)) == 0.0


def test_a_clock_of_another_beginning_is_shifted_to_ours() -> None:
    library = SimpleNamespace(local_clock=lambda: time.monotonic() + 1000.0)
    assert to_monotonic_s(library) == pytest.approx(-1000.0, abs=1.0)
