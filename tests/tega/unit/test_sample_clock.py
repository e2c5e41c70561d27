"""Stamps under bunched arrivals, the measured rate, and losses that only time shows."""

from __future__ import annotations

import sys
import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from tega.devices.sample_clock import SampleClock

MS = 1_000_000


def test_bunched_arrivals_are_stamped_with_the_time_of_the_samples() -> None:
    # An adapter that delivers every 16 ms, up to 3 ms late; the first delivery happens to be late as well.
    rng = np.random.default_rng(1)
    clock, errors = SampleClock(250.0), []
    for k in range(1, 1000):
        late_ns = int(rng.uniform(0.1, 3.0) * MS)
        stamp = clock.take(4, k * 16 * MS + late_ns)
        errors.append(stamp.t_ns - k * 16 * MS)
    # As far under the earliest arrivals as the fitted rate is off within a second.
    assert min(errors[100:]) >= -0.3 * MS
    assert max(errors[100:]) <= 0.6 * MS
    assert max(errors) <= 3 * MS


def test_a_stamp_never_decreases_and_never_lies_in_the_future() -> None:
    rng = np.random.default_rng(2)
    clock, arrival_ns, last_ns = SampleClock(1000.0), 0, 0
    for _ in range(2000):
        n = int(rng.integers(1, 40))
        arrival_ns += int(rng.exponential(n * MS))
        stamp = clock.take(n, arrival_ns)
        assert last_ns <= stamp.t_ns <= arrival_ns
        last_ns = stamp.t_ns


@pytest.mark.parametrize("true_hz", [20.0, 249.0, 251.5, 480.0, 2000.0])
def test_the_true_rate_is_measured_whatever_was_said(true_hz: float) -> None:
    clock = SampleClock(250.0)
    for k in range(1, 400):
        clock.take(10, round(k * 10 / true_hz * 1e9))
    assert clock.measured_hz == pytest.approx(true_hz, rel=1e-6)


@pytest.mark.parametrize("rate_hz", [250.0, 1000.0])
def test_a_rate_is_proven_in_a_third_of_a_second_of_an_adapter_s_bunches(rate_hz: float) -> None:
    clock, n = SampleClock(rate_hz), 0
    for k in range(1, 100):
        proven_s = k * 0.016
        came = int(proven_s * rate_hz) - n
        n += came
        clock.take(came, k * 16 * MS)
        if clock.proves(rate_hz, 0.05):
            break
    assert 0.3 < proven_s < 0.4


@given(
    share=st.floats(0.0501, 0.3),
    faster=st.booleans(),
    late_ms=st.lists(st.floats(0.0, 16.0), min_size=2, max_size=12),
    batch=st.integers(1, 8),
)
def test_another_rate_is_never_proven_however_its_samples_are_late(share, faster, late_ms, batch) -> None:
    true_hz = 1000.0 * (1 + share if faster else 1 - share)
    clock, before_ns = SampleClock(1000.0), 0
    n_batches = int(1.0 * true_hz / batch)
    # Lateness goes in straight lines, the hardest to tell from another rate.
    late = np.interp(np.linspace(0, len(late_ms) - 1, n_batches), range(len(late_ms)), late_ms)
    for k in range(1, n_batches):
        before_ns = max(before_ns, round(k * batch / true_hz * 1e9 + late[k] * MS))
        clock.take(batch, before_ns)
        assert k % 40 or not clock.proves(1000.0, 0.05)


def test_what_comes_after_a_proof_is_stamped_at_the_rate_that_was_measured() -> None:
    # 3 % slow: at the rate it is said to have, the first second's stamps would come to lie 29 ms early.
    clock, true_hz, k = SampleClock(1000.0), 970.0, 0
    while not clock.proves(1000.0, 0.05):
        k += 1
        clock.take(4, round(k * 4 / true_hz * 1e9))
    assert k * 4 / true_hz < 1.0
    clock.restart()
    for later in range(k + 1, k + round(true_hz / 4)):
        true_ns = round(later * 4 / true_hz * 1e9)
        assert abs(clock.take(4, true_ns).t_ns - true_ns) < 1 * MS


def test_a_drifting_clock_is_followed() -> None:
    clock = SampleClock(250.0)
    for k in range(1, 4000):
        true_ns = round(k * 16 * MS * 1.02)
        stamp = clock.take(4, true_ns + (k % 3) * MS)
        assert abs(stamp.t_ns - true_ns) < 25 * MS
    assert abs(stamp.t_ns - true_ns) < 2 * MS


def test_the_counters_losses_keep_the_stamps_in_step() -> None:
    clock = SampleClock(250.0, counter_turn=256)
    clock.take(4, 16 * MS)
    stamp = clock.take(4, 16 * MS + 54 * 4 * MS, n_missing=50)
    assert stamp == (16 * MS + 54 * 4 * MS, 0)


def test_a_loss_of_whole_turns_is_found_by_time_and_only_once() -> None:
    clock, lost, now_ns = SampleClock(250.0, counter_turn=256), [], 0
    for k in range(2000):
        now_ns += 16 * MS
        if k == 700:
            now_ns += 512 * 4 * MS  # twice round: the counter goes on as if nothing had happened
        lost.append(clock.take(4, now_ns).n_lost)
    assert sum(lost) == 512
    assert 700 < lost.index(512) < 700 + 130


@pytest.mark.parametrize("share", [0.2, 0.33, 0.9])
def test_a_stream_that_becomes_slow_is_no_loss(share: float) -> None:
    clock, now_ns = SampleClock(500.0, counter_turn=256), 0
    for k in range(2000):
        now_ns += round(8 * MS / (1.0 if k < 500 else share))
        assert clock.take(4, now_ns).n_lost == 0
    assert clock.measured_hz == pytest.approx(500.0 * share, rel=0.01)


def test_there_is_room_for_as_many_losses_as_time_has_passed() -> None:
    clock = SampleClock(250.0, counter_turn=256)
    for k in range(1, 200):
        clock.take(4, k * 16 * MS)
        assert k > 11 or clock.measured_hz is None  # too little for a rate
    on_time_ns = 200 * 16 * MS
    assert clock.room(4, on_time_ns) <= 13
    assert 100 <= clock.room(4, on_time_ns + 400 * MS) <= 113


def test_a_late_delivery_is_no_loss() -> None:
    # The host was busy for 1.5 s and then got everything at once.
    clock, lost = SampleClock(250.0, counter_turn=256), 0
    for k in range(1, 2000):
        arrival_ns = k * 16 * MS
        if 700 <= k < 794:
            arrival_ns = 794 * 16 * MS
        lost += clock.take(4, arrival_ns).n_lost
    assert lost == 0


def test_the_rate_can_be_asked_for_by_another_thread() -> None:
    clock, over = SampleClock(1000.0), threading.Event()

    def feed() -> None:
        for k in range(20_000):
            clock.take(1, k * 1_000_000)
        over.set()

    before_s = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    try:
        feeder = threading.Thread(target=feed)
        feeder.start()
        while not over.is_set():
            assert (clock.measured_hz or 1000.0) == pytest.approx(1000.0, rel=1e-6)
        feeder.join()
    finally:
        sys.setswitchinterval(before_s)
