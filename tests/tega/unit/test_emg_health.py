"""Faults of an EMG signal, tired muscles and moved electrodes, and the words for them; none where there is none."""

from __future__ import annotations

from functools import cache
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.signal import butter, sosfilt

from tega.config.calibration import EmgMaxima
from tega.devices.base import EmgChunk
from tega.devices.emg.emg_health import EmgHealth, swapped_channels
from tega.loop.emg_condition import MOVED, ConditionWatch
from tega.records import MuscleCondition
from tega.runtime.files.signals import read_signals
from tega.runtime.files.tables.table import Reading

Samples = NDArray[np.float64]
NAMES = ("ch1", "ch2", "ch3")
RATE_HZ = 500.0


def looked_at(
    samples: Samples,
    rate_hz: float = RATE_HZ,
    limits: tuple[float, float] | None = (-5000.0, 5000.0),
    chunk: int = 7,
) -> EmgHealth:
    health = EmgHealth(rate_hz, NAMES[: samples.shape[1]], limits=limits)
    for first in range(0, len(samples), chunk):
        health.take(EmgChunk(0, first, samples[first : first + chunk]))
    return health


def muscle(seconds: float = 4.0, rate_hz: float = RATE_HZ) -> Samples:
    """Return three channels of noise with a band like EMG's, in a contraction, with some of it shared."""
    n = round(seconds * rate_hz)
    band = np.diff(np.random.default_rng(3).standard_normal((n + 3, 3)), axis=0)
    band = band[:-2] + band[1:-1] + band[2:]
    band = 0.85 * band + 0.15 * np.roll(band, 1, axis=1)
    effort = 10 + 250 * np.abs(np.sin(np.arange(n) / rate_hz))
    signal: Samples = band[:n] * effort[:, None] + [12.0, -8.0, 5.0]
    return signal


T_S = np.arange(2000) / RATE_HZ
MAINS = np.sin(2 * np.pi * 50 * T_S)


@pytest.mark.parametrize(
    ("signal", "words"),
    [
        (np.full(2000, 5000.0), "at the converter's limit: electrode off"),
        (np.full(2000, 3.0), "no signal at all"),
        (np.clip(muscle()[:, 1] * 30, -5000, 5000), "clipped"),
        (muscle()[:, 1] + 130 * MAINS, "50 Hz mains: check the reference"),
        (muscle()[:, 1] * 0.3 + 900 * MAINS, "mostly 50 Hz mains: electrode or reference loose"),
        (np.where(T_S < 1.5, 1e308, np.where(T_S % 0.1 < 0.01, np.nan, np.inf)), "no numbers"),
    ],
)
def test_each_fault_is_named_on_its_own_channel(signal: Samples, words: str) -> None:
    samples = muscle()
    samples[:, 1] = signal
    (text,) = looked_at(samples).now
    assert text.startswith("ch2: ")
    assert words in text


def test_mains_of_60_hz_are_called_so_and_those_in_all_channels_no_bridge() -> None:
    found = looked_at(muscle() + 300 * np.sin(2 * np.pi * 60 * T_S)[:, None]).now
    assert all("60 Hz mains" in words for words in found)
    assert not [w for w in looked_at(0.05 * muscle() + 900 * MAINS[:, None]).now if "bridged" in w]


def test_bridged_electrodes_show_the_same_signal_and_envelopes_that_rise_together_do_not() -> None:
    samples = muscle()
    samples[:, 2] = 0.5 * samples[:, 0] + 0.05 * samples[:, 1]
    assert looked_at(samples).now == ("ch1 and ch3: the same signal: electrodes bridged by gel or sweat",)
    effort = np.abs(np.sin(T_S))[:, None] * [300.0, 250.0, 400.0]
    assert looked_at(effort + np.random.default_rng(0).normal(0, 0.01, effort.shape)).now == ()


def test_repeated_rows_tell_the_true_rate() -> None:
    text = looked_at(np.repeat(muscle()[:500], 4, axis=0)).now
    assert text == ("rows repeat: only about 124 of 500 samples/s are new",)


def test_gaps_are_counted_with_the_longest() -> None:
    health = EmgHealth(RATE_HZ, NAMES)
    samples = muscle()
    for first, index in ((0, 0), (100, 103), (200, 250)):
        health.take(EmgChunk(0, index, samples[first : first + 100]))
    assert health.words() == ("50 samples were lost in 2 gaps, the longest 94 ms",)


@pytest.mark.parametrize("chunk", [7, 150, 249, 1100])
def test_words_say_how_long_a_fault_lasted_after_it_is_over(chunk: int) -> None:
    samples = muscle()
    samples[:500, 0] = 5000.0
    health = looked_at(samples, chunk=chunk)
    assert health.now == ()
    assert [w for w in health.words() if w.startswith("ch1")] == [
        "ch1: at the converter's limit: electrode off, cable out, or amplifier saturated (for 1 s)"
    ]


@pytest.mark.parametrize("rate_hz", [200.0, 250.0, 500.0, 1000.0, 5000.0])
def test_a_sound_signal_is_not_spoken_of_nor_saturation_without_limits(rate_hz: float) -> None:
    health = looked_at(muscle(rate_hz=rate_hz), rate_hz)
    assert health.now == health.words() == ()
    clipped = np.clip(muscle(rate_hz=rate_hz) * 30, -5000, 5000)
    assert looked_at(clipped, rate_hz, limits=None).now == ()


def squeezes(recordings: Path, name: str, channels: tuple[int, ...] = ()) -> Samples:
    path = recordings / "emg" / "my_thesis" / f"recording_force_{name}.mat"
    return read_signals(path, Reading(channels=channels)).samples


@pytest.mark.parametrize("name", ["v1", "v2", "v8", "v10"])
def test_real_squeezes_show_nothing_but_what_is_in_them(recordings: Path, name: str) -> None:
    # They clip in strong squeezes, and between squeezes a 60 Hz line of about one count is left, at places.
    text = looked_at(squeezes(recordings, name, (3, 6, 8)), 200.0, limits=(-128.0, 127.0)).words()
    assert not [w for w in text if "clipped" not in w and ": 60 Hz mains" not in w], text


def test_swapped_electrodes() -> None:
    own = [[0.9, 0.2, 0.1], [0.3, 0.8, 0.3], [0.2, 0.1, 0.7]]
    assert swapped_channels(own, NAMES) == ""
    assert swapped_channels([own[1], own[0], own[2]], NAMES).startswith("ch1 and ch2 look swapped")
    mixed = "ch2 belongs where ch1 is, ch3 belongs where ch2 is, ch1 belongs where ch3 is"
    assert swapped_channels([own[1], own[2], own[0]], NAMES) == f"electrodes look mixed up: {mixed}"
    # Muscles that work together.
    assert swapped_channels([[0.6, 0.65, 0.5], [0.6, 0.55, 0.5], [0.4, 0.5, 0.6]], NAMES) == ""


def maxima(samples: Samples, rate_hz: float, full: float | None = None) -> EmgMaxima:
    tau = round(rate_hz / 10)
    blocks = np.abs(samples - samples.mean(axis=0))[: len(samples) // tau * tau]
    found = np.percentile(blocks.reshape(-1, tau, samples.shape[1]).mean(axis=1), 95, axis=0).tolist()
    full_size = tuple(found) if full is None else (full,) * len(found)
    names = tuple(f"ch{k + 1}" for k in range(samples.shape[1]))
    return EmgMaxima(kind="raw", rate_hz=rate_hz, tau=tau, channels=names, maxima=full_size)


def watched(
    samples: Samples, rate_hz: float, cuts: list[int] | tuple[int, ...] = (), *, full: float | None = None
) -> list[MuscleCondition]:
    watch, ends = ConditionWatch(maxima(samples, rate_hz, full)), [0, *sorted(cuts), len(samples)]
    chunks = [EmgChunk(0, first, samples[first:end]) for first, end in pairwise(ends)]
    return [found for chunk in chunks for found in watch.take(chunk)]


@cache
def band(percent: int) -> Samples:
    return np.asarray(butter(2, (0.4 * percent, 1.6 * percent), "bandpass", fs=1000, output="sos"))


def effort(minutes: float, lowest: float, seed: int = 1) -> Samples:
    """Return 1 kHz of two channels in steady effort; the band of the first moves down to so much of itself."""
    rng = np.random.default_rng(seed)
    parts = []
    for k in range(round(60 * minutes)):
        percent = round(100 - 100 * (1 - lowest) * k / (60 * minutes))
        noise = rng.normal(size=(1300, 2))
        second = np.column_stack([sosfilt(band(p), noise[:, c])[300:] for c, p in enumerate((percent, 100))])
        parts.append(second / second.std(axis=0) * 50)
    return np.concatenate(parts)


def test_a_spectrum_that_falls_is_told_as_a_tired_muscle_and_a_steady_one_is_not() -> None:
    found = watched(effort(3.0, 0.7), 1000.0)
    assert len(found) == 180
    assert found[-1].said.startswith("ch1: tired: its median frequency fell by ")
    assert "ch2" not in found[-1].said
    fell = found[-1].median_hz[0] / found[0].median_hz[0]
    assert 0.55 < fell < 0.85
    assert found[-1].slope_percent_per_min[0] == pytest.approx(-30 / 3, rel=0.25)
    assert abs(found[-1].slope_percent_per_min[1]) < 1.0
    # A slope takes twenty seconds of effort before it, and twenty after them.
    known = np.isfinite([one.slope_percent_per_min for one in found])
    assert not known[:39].any()
    assert known[39:].all()
    assert not any(one.said for one in watched(effort(2.0, 1.0, seed=2), 1000.0))


def test_rest_is_no_evidence_and_a_lost_second_is_passed_over() -> None:
    samples = effort(0.5, 1.0)
    samples[10_000:20_000] *= 0.001
    assert len(watched(samples, 1000.0)) == 20
    samples[5_500, 1] = np.nan
    watch = ConditionWatch(maxima(np.nan_to_num(samples), 1000.0))
    assert len(watch.take(EmgChunk(0, 0, samples))) == 19
    assert len(watch.take(EmgChunk(0, 30_700, samples[:1000]))) == 1  # 700 samples never came


@pytest.fixture(scope="module")
def half_a_minute() -> tuple[Samples, str]:
    """Samples, and what is found in them at once; NaN is unlike itself, so rows are compared as they are written."""
    samples = effort(0.5, 0.8)
    return samples, str(watched(samples, 1000.0))


@settings(max_examples=10, deadline=None)
@given(st.lists(st.integers(0, 30_000), max_size=10))
def test_chunks_do_not_matter(half_a_minute: tuple[Samples, str], cuts: list[int]) -> None:
    samples, whole = half_a_minute
    assert str(watched(samples, 1000.0, cuts)) == whole


def test_moved_pods_are_told_and_pods_in_their_place_are_not(recordings: Path) -> None:
    """In-sample: the threshold was set on these six recordings; pods are moved by rotating the channels."""
    intact, moved = 0, 0
    for name in ("v1", "v2", "v6", "v8", "v10", "v12"):
        samples = squeezes(recordings, name)
        half = len(samples) // 2
        full = np.array(maxima(samples, 200.0).maxima)
        for columns in ([2, 5, 7], list(range(8))):
            for places in (0, 1, 2, 7):
                # A pod brings its own maximum along: what moves is the muscle under it.
                turned = np.roll(samples / full, places, axis=1)
                whole = np.concatenate([samples[:half] / full, turned[half:]])[:, columns]
                found = watched(whole, 200.0, full=1.0)
                reported = any(one.pattern_change > MOVED for one in found)
                intact += reported and not places
                moved += reported and bool(places)
    assert (intact, moved) == (0, 20)  # of 12 and of 36
