"""The rule for live streams: evidence that contradicts what is assumed is a fault, and evidence that agrees is none."""

from __future__ import annotations

import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.typing import NDArray

from tega.devices.emg.stream_evidence import AlternationCheck, PacketOrder, ValueCheck
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


@given(st.integers(0, 2**32 - 1), st.sampled_from(["raw", "rectified", "envelope", "flat", "squeeze"]))
def test_a_muscle_is_never_taken_for_a_counter(seed: int, kind: str) -> None:
    rng = np.random.default_rng(seed)
    raw = rng.normal(0, 60, 1200)
    smooth = np.convolve(np.abs(raw), np.ones(40) / 40, "same")
    signals = {
        "raw": raw,
        "rectified": np.abs(raw),
        "envelope": smooth,
        "flat": np.zeros(1200),
        "squeeze": smooth * np.clip(np.arange(1200) / 400, 0, 1),
    }
    assert found_in(signals[kind][:, np.newaxis]) == []


def test_contradictions_are_kept_after_they_are_over() -> None:
    found, check = Contradictions(), ValueCheck(200.0, ["ch1"], limits=(0.0, 1.0), free_columns=False)
    check.take(np.full((100, 1), 2.0), found)
    check.take(np.full((100, 1), 0.5), found)
    assert found.now == ()
    assert [one.evidence for one in found.seen] == ["values"]
