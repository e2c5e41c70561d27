"""Live streams: their stamps, rate and losses, and evidence that contradicts what is assumed."""

from __future__ import annotations

import re
import sys
import threading

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from tega.devices.emg.stream_evidence import AlternationCheck, PacketOrder, ValueCheck
from tega.devices.sample_clock import SampleClock
from tega.runtime.evidence import Contradictions, StampCheck


def fed(counters: list[int], *, room: int = 12, same: bool = False) -> tuple[PacketOrder, list[int]]:
    """Return the order after packets with these numbers, one by one, and the numbers that were passed on."""
    order, passed, last = PacketOrder(256), list[int](), counters[0] - 1
    for k, counter in enumerate(counters):
        row = np.full((1, 2), 0.0 if same else float(k))
        kept, _ = order.once(row, np.array([(counter - last - 1) % 256]), room)
        passed += [counter] * len(kept)
        last = counter
    return order, passed


@pytest.mark.parametrize(
    ("numbers", "words"),
    [
        ([65] * 64, "does not move in"),
        ([0, 65, 65] * 24, "does not move by one in"),
        ([k // 2 % 256 for k in range(80)], "does not move by one in"),
        ([(k * 97) % 256 for k in range(80)], "does not move by one in"),
    ],
    ids=["stands", "every third shifted", "each number twice", "no counter"],
)
def test_numbers_that_are_no_counter_are_a_contradiction(numbers: list[int], words: str) -> None:
    order, _ = fed(numbers)
    assert order.contradiction is not None
    assert order.contradiction.evidence == "counter"
    assert words in order.contradiction.found


@pytest.mark.parametrize("odd", [[200], [100, 101]])
def test_packets_whose_numbers_cannot_be_true_are_left_out_and_their_places_kept(odd: list[int]) -> None:
    later = range(20 + len(odd), 60)
    order, passed = fed([*range(20), *odd, *later])
    assert passed == [*range(20), *later]
    assert (order.n_damaged, order.contradiction) == (len(odd), None)


def test_a_device_that_begins_to_count_from_elsewhere_is_followed_again() -> None:
    _, passed = fed([*range(40), *range(150, 200)])
    assert passed[-1] == 199
    assert len(passed) >= 40 + 50 - 8


@given(st.lists(st.sampled_from(["next", "lost", "twice"]), min_size=1, max_size=200))
def test_true_losses_and_repeats_keep_every_packet_at_its_place(events: list[str]) -> None:
    order, place = PacketOrder(256), 0
    places, indices, index = list[float](), list[int](), -1
    for event in events:
        step = {"next": 1, "lost": 3, "twice": 0 if place else 1}[event]
        place += step
        kept, missing = order.once(np.full((1, 1), float(place)), np.array([(step - 1) % 256]), 12)
        for row, n_missing in zip(kept, missing, strict=True):
            index += 1 + int(n_missing)
            places.append(row[0])
            indices.append(index)
    # All packets twice are half of a counter that stands, so a run of repeats may be one.
    assert order.contradiction is None or events.count("twice") > 20
    assert order.n_damaged == 0
    assert np.diff(places).tolist() == np.diff(indices).tolist()
    assert len(set(places)) == len(places)


def alternating(
    even: NDArray[np.float64], odd: NDArray[np.float64], used: tuple[int, ...] = (1, 2, 3)
) -> str:
    """Return the finding for packets of which those of even number are ``even``."""
    volts = np.empty((2 * len(even), 8))
    volts[::2], volts[1::2] = even, odd
    check = AlternationCheck(used, step_uv=0.0224)
    check.take(np.arange(len(volts)).astype(np.uint8), volts)
    for part in np.array_split(volts, 4):  # in other pieces the same
        check.take(np.arange(len(part)).astype(np.uint8), part)
    return check.found


@pytest.mark.parametrize("seed", range(20))
def test_two_electrodes_are_told_apart_and_one_never(seed: int) -> None:
    rng = np.random.default_rng(seed)
    rest, effort, offset = rng.normal(0, 5, (400, 8)), rng.normal(0, 300, (400, 8)), np.zeros((400, 8))
    assert alternating(rest[::2], rest[1::2], used=tuple(range(1, 9))) == ""
    bursts = effort * rng.gamma(0.5, 1, (400, 1))
    assert alternating(bursts[::2], bursts[1::2], used=tuple(range(1, 9))) == ""
    assert "different electrodes" in alternating(effort[::2], rest[1::2], used=tuple(range(1, 9)))
    offset[:, 0] = 11_000
    assert "different electrodes" in alternating((rest + offset)[::2], rest[1::2], used=tuple(range(1, 9)))
    assert alternating(np.zeros((200, 8)), np.zeros((200, 8))) == ""


def test_one_comparison_that_differs_decides_nothing() -> None:
    rng, check = np.random.default_rng(1), AlternationCheck((1, 2, 3), step_uv=0.0224)
    volts, counters = rng.normal(0, 5, (100, 8)), np.arange(100, dtype=np.uint8)
    volts[::2, 0] += 11_000
    check.take(counters, volts)
    assert (check.is_decided, check.found) == (False, "")
    volts[::2, 0] -= 11_000
    check.take(counters, volts)
    assert (check.is_decided, check.found) == (True, "")


def test_switched_off_channels_that_move_show_shifted_bytes() -> None:
    volts = np.zeros((200, 8))
    volts[:, 4] = np.random.default_rng(1).integers(-128, 128, 200) * 65536 * 0.0224
    assert "switched off move" in alternating(volts[::2], volts[1::2])


@pytest.mark.parametrize("lag_s", [-5.0, 20.0, 1800.0, -1.7e9, float("nan")])
def test_stamps_of_another_clock_are_not_believed(lag_s: float) -> None:
    check = StampCheck()
    assert not check.believes(100.0 - lag_s, 100.0)
    assert check.contradiction is not None
    assert check.contradiction.evidence == "stamp"


def test_a_clock_that_is_set_back_is_seen_at_once_and_believed_again_later() -> None:
    check = StampCheck()
    believed = [check.believes(t - (2.0 if 30 <= t < 40 else 0.0), t + 0.01) for t in np.arange(0, 60, 0.1)]
    assert believed[299]
    assert not any(believed[300:449])
    assert believed[460]
    assert check.contradiction is None


def test_the_smallest_delay_of_a_second_is_the_delay() -> None:
    check = StampCheck()
    for k in range(200):
        check.believes(k * 0.01, 0.05 + 0.1 * np.ceil(k * 0.1))  # ten samples arrive at once
    assert check.delay_s == pytest.approx(0.05)


def found_in(samples: NDArray[np.float64], **options: object) -> list[str]:
    make = {"limits": None, "free_columns": True} | options
    found = Contradictions()
    check = ValueCheck(200.0, [f"ch{k + 1}" for k in range(samples.shape[1])], **make)  # type: ignore[arg-type]
    for part in np.array_split(samples, 37):
        check.take(part, found)
    return [str(one) for one in found.now]


def test_columns_that_count_and_values_beyond_the_converter_are_contradictions() -> None:
    rng, n = np.random.default_rng(1), 800
    emg = rng.normal(512, 60, (n, 1))
    for column in (
        np.arange(n) % 256,  # a counter of eight bits
        -np.arange(n) / 200,
        1.7e9 + np.cumsum(rng.uniform(0.004, 0.006, n)),  # seconds with jitter
    ):
        (words,) = found_in(np.column_stack([emg, column]))
        assert re.match(r"values: ch2 changes by .* a counter or a time stamp", words)
        assert found_in(np.column_stack([emg, column]), free_columns=False) == []
    assert found_in(emg, limits=(0.0, 1023.0)) == []
    (words,) = found_in(4 * emg, limits=(0.0, 1023.0), free_columns=False)
    assert re.match(r"values: ch1 reaches [\d.]+, the converter is said to give 0 to 1023", words)


@given(st.integers(0, 2**32 - 1), st.sampled_from(["raw", "rectified", "envelope", "flat", "squeeze", "inf"]))
def test_a_muscle_is_never_taken_for_a_counter(seed: int, kind: str) -> None:
    rng = np.random.default_rng(seed)
    raw = rng.normal(0, 60, 1200)
    smooth = np.convolve(np.abs(raw), np.ones(40) / 40, "same")
    signals = {
        "raw": raw,
        "rectified": np.abs(raw),
        "envelope": smooth,
        "flat": np.zeros(1200),
        "inf": np.where(raw > 0, np.inf, 1e308 * np.sign(raw)),
        "squeeze": smooth * np.clip(np.arange(1200) / 400, 0, 1),
    }
    assert found_in(signals[kind][:, np.newaxis]) == []


def test_contradictions_are_kept_after_they_are_over() -> None:
    found, check = Contradictions(), ValueCheck(200.0, ["ch1"], limits=(0.0, 1.0), free_columns=False)
    check.take(np.full((100, 1), 2.0), found)
    check.take(np.full((100, 1), 0.5), found)
    assert found.now == ()
    assert [one.evidence for one in found.seen] == ["values"]


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
