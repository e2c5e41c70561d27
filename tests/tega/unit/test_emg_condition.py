"""Fatigue and moved electrodes: simulated spectra that fall, real recordings with their pods moved, runs that tell."""

from __future__ import annotations

import os
from functools import cache
from itertools import pairwise
from pathlib import Path

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray
from scipy.io import loadmat
from scipy.signal import butter, sosfilt

from tega.config.calibration import EmgMaxima
from tega.devices.base import EmgChunk
from tega.loop.emg_condition import MOVED, ConditionWatch
from tega.records import MuscleCondition

Samples = NDArray[np.float64]
DATA = Path(os.environ.get("TEGA_DATA", "../shared/data")) / "emg" / "my_thesis"


def maxima(samples: Samples, rate_hz: float) -> EmgMaxima:
    tau = round(rate_hz / 10)
    blocks = np.abs(samples - samples.mean(axis=0))[: len(samples) // tau * tau]
    full = np.percentile(blocks.reshape(-1, tau, samples.shape[1]).mean(axis=1), 95, axis=0)
    names = tuple(f"ch{k + 1}" for k in range(samples.shape[1]))
    return EmgMaxima(kind="raw", rate_hz=rate_hz, tau=tau, channels=names, maxima=tuple(full.tolist()))


def watched(
    samples: Samples, rate_hz: float, cuts: list[int] | tuple[int, ...] = (), *, full: float | None = None
) -> list[MuscleCondition]:
    used = maxima(samples, rate_hz)
    if full is not None:
        used = msgspec.structs.replace(used, maxima=(full,) * samples.shape[1])
    watch, ends = ConditionWatch(used), [0, *sorted(cuts), len(samples)]
    chunks = [EmgChunk(0, first, samples[first:end]) for first, end in pairwise(ends)]
    return [found for chunk in chunks for found in watch.take(chunk)]


@cache
def band(percent: int) -> NDArray[np.float64]:
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


def test_moved_pods_are_told_and_pods_in_their_place_are_not() -> None:
    """In-sample: the threshold was set on these six recordings; pods are moved by rotating the channels."""
    if not DATA.is_dir():
        pytest.skip(f"{DATA} is absent")
    intact, moved = 0, 0
    for name in ("v1", "v2", "v6", "v8", "v10", "v12"):
        samples = np.asarray(loadmat(DATA / f"recording_force_{name}.mat")["emg"], np.float64)
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
