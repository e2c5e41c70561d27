"""The clock of the Lab Streaming Layer is brought to this machine's monotonic clock, and its correction followed."""

from __future__ import annotations

import time
from types import SimpleNamespace

import pytest

from tega_lsl.library import ClockCorrection, to_monotonic_s


def test_a_thread_that_is_put_aside_between_two_looks_moves_no_time() -> None:
    """The library's clock is ours on Linux: a marker's time must not hang on how long two calls took."""

    def looked_at_late() -> float:
        time.sleep(0.02)
        return time.monotonic()

    assert to_monotonic_s(SimpleNamespace(local_clock=looked_at_late)) == 0.0


def test_a_clock_of_another_beginning_is_shifted_to_ours() -> None:
    library = SimpleNamespace(local_clock=lambda: time.monotonic() + 1000.0)
    assert to_monotonic_s(library) == pytest.approx(-1000.0, abs=1.0)


def test_a_correction_follows_drift_and_leaves_single_outliers_out() -> None:
    clock = ClockCorrection("s", 0.0, 0.0)
    for k in range(1, 60):
        now_s = float(k)
        value = 5.0 if k % 7 == 0 else 0.01 * now_s
        clock.follow(lambda value=value: value, now_s)  # type: ignore[misc]
        assert abs(clock.value_s - 0.01 * now_s) < 0.021
    assert clock.n_outliers == 8
    assert clock.n_asked == 60


def test_a_correction_that_stays_elsewhere_is_used_after_five_seconds() -> None:
    clock = ClockCorrection("s", 0.0, 0.0)
    used = [clock.follow(lambda: 3.0, float(k)) for k in range(1, 12)]
    assert used[:5] == [0.0] * 5
    assert used[-1] == 3.0


def test_a_clock_that_cannot_be_asked_keeps_its_correction() -> None:
    def lost() -> float:
        raise TimeoutError

    assert ClockCorrection("s", 0.25, 0.0).follow(lost, 9.0) == 0.25
