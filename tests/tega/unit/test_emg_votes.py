"""Channels that measure no muscle have no vote, none that measures one loses it, and each vote is the reference's."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import cycle
from pathlib import Path
from typing import get_args

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tega.config.calibration import EmgMaxima
from tega.config.choose import muscle_setup
from tega.devices.base import EmgChunk
from tega.emg import InputKind, Preset, channel_maxima
from tega.emg.votes import ChannelVotes
from tega.loop.inbox.sources import BlockMeter, SourceReport
from tega.records import Intent
from tega.runtime.files.signals import read_signals
from tega.stages.decoders import RulesDecoder, RulesOptions

Samples = NDArray[np.float64]
RATE_HZ, TAU = 250.0, 25
RAIL = 187_500.0


def squeeze(n: int, *, seed: int = 1, size: float = 100.0) -> Samples:
    return np.random.default_rng(seed).normal(0, size, (n, 3))


def hum(n: int, *, size: float = 400.0, line_hz: float = 50.0) -> Samples:
    rng = np.random.default_rng(5)
    turns = 2 * np.pi * line_hz * np.arange(n) / RATE_HZ
    wave: Samples = rng.normal(0, 10, (n, 3)) + size * np.sin(turns)[:, None]
    return wave


def levels(
    samples: Samples, *, preset: Preset = "live", cut: Sequence[int] = (4,)
) -> tuple[list[Intent], SourceReport]:
    maximum = float(channel_maxima(squeeze(2000)[:, :1], RATE_HZ, tau=TAU)[0])
    maxima = EmgMaxima(kind="raw", rate_hz=RATE_HZ, tau=TAU, channels=("a", "b", "c"), maxima=(maximum,) * 3)
    decoder, report = RulesDecoder(muscle_setup(maxima, preset), RulesOptions()), SourceReport()
    meter = BlockMeter(decoder, report, maxima=maxima, live=False)
    blocks, at, k = list[Intent](), 0, 0
    while at < len(samples):
        part = samples[at : at + cut[k % len(cut)]]
        at, k = at + len(part), k + 1
        blocks += meter.take(EmgChunk(round(at * 1e9 / RATE_HZ), at - len(part), part))
    return blocks, report


@pytest.mark.parametrize("preset", ["paper", "live"])
@pytest.mark.parametrize("begin", [500, 509, 524])
@pytest.mark.parametrize("fault", ["rail", "flat", "hum", "hum 60"])
def test_a_fault_of_every_channel_keeps_the_level_before_it(fault: str, begin: int, preset: Preset) -> None:
    samples = squeeze(1000)
    if fault.startswith("hum"):
        samples[begin:] = hum(1000 - begin, line_hz=60.0 if "60" in fault else 50.0)
    else:
        samples[begin:] = RAIL if fault == "rail" else 0.0
    blocks, report = levels(samples, preset=preset)
    before = blocks[begin // TAU - 1].level
    seen = next(k for k, block in enumerate(blocks) if not any(block.channels))
    # The end of the block in which a fifth of a second of it is over.
    assert seen * TAU <= begin + 0.2 * RATE_HZ
    assert {block.level for block in blocks[seen:]} == {before}
    # Until it is seen the hand is not opened; a block that was half stuck may ask for a little less.
    assert min(block.level for block in blocks[begin // TAU - 1 :]) >= before - 1
    assert len(report.faults) == 3
    assert ("mains" if "hum" in fault else "stays at") in report.faults[0]


@settings(max_examples=20)
@given(cut=st.lists(st.integers(1, 60), min_size=1, max_size=6), fault=st.sampled_from(["rail", "hum"]))
def test_neither_votes_nor_stamps_depend_on_how_samples_are_cut(cut: list[int], fault: str) -> None:
    samples = squeeze(900)
    samples[310:560] = RAIL if fault == "rail" else hum(250)
    samples[600:640, 1] = np.nan
    whole, _ = levels(samples, cut=(900,))
    assert [block.t_ns for block in whole] == [k * 100_000_000 for k in range(1, 37)]
    assert levels(samples, cut=cut)[0] == whole


def test_mains_that_move_nothing_are_left_alone() -> None:
    blocks, report = levels(np.concatenate([squeeze(500), hum(500, size=5.0)]))
    assert report.faults == ()
    assert blocks[-1].level == 1


def read_all(folder: Path) -> Iterator[tuple[str, InputKind, float, Samples]]:
    thesis, inail = (sorted(folder.glob(f"{name}/*.mat")) for name in ("my_thesis", "unibo_inail"))
    yield from ((path.name, "raw", 200.0, read_signals(path).samples) for path in thesis)
    yield from ((path.name, "envelope", 500.0, read_signals(path).samples) for path in inail)
    for name in ("longterm_myo", "libemg_tests"):
        parts = [np.loadtxt(path, delimiter=",") for path in sorted(folder.glob(f"{name}/*.csv"))]
        yield name, "raw", 200.0, np.concatenate(parts)
    yield "biosppy", "raw", 1000.0, np.loadtxt(folder / "biosppy/emg_1.txt").reshape(-1, 1)


def test_no_channel_of_a_person_loses_its_vote(recordings: Path) -> None:
    """Squeezes that clip among them (3.7 % of their samples), and the mains between the bursts of one recording."""
    n_channels = 0
    for name, kind, rate_hz, samples in read_all(recordings / "emg"):
        tau = round(rate_hz / 10)
        maxima = channel_maxima(samples, rate_hz, tau=tau, kind=kind)
        names = [f"ch{k + 1}" for k in range(samples.shape[1])]
        votes = ChannelVotes(rate_hz, tau, kind, names, maxima.tolist())
        for at in range(0, len(samples), tau):
            votes.take(samples[at : at + tau])
            assert votes.faults == {}, f"{name} at {at / rate_hz:.1f} s"
        n_channels += len(names)
    assert n_channels == 6 * 8 + 2 * 4 + 8 + 8 + 1


FULL = 40.0

parts = st.one_of(
    st.tuples(st.just("muscle"), st.floats(0, 40)),
    st.tuples(st.just("mains"), st.floats(0.85, 0.99)),
    st.tuples(st.just("mains"), st.floats(0.915, 0.925)),
    st.tuples(st.just("stuck"), st.sampled_from([0.0, -0.0, 3.0, 10.0, 1023.0, -187_500.0, np.inf, 1e300])),
    st.tuples(st.just("missing"), st.just(np.nan)),
)


def made(
    subject: str, size: float, n: int, *, rate_hz: float, line_hz: float, rng: np.random.Generator
) -> Samples:
    """Return a part of one channel: muscle of a size, mains of a share of the power, or one value throughout."""
    noise = rng.normal(size=n)
    if subject == "muscle":
        return size * noise
    if subject == "mains":
        turns = line_hz * np.arange(n) / rate_hz + rng.uniform()
        wave = np.sin(2 * np.pi * turns) * np.sqrt(2 * size) + noise * np.sqrt(1 - size)
        loud: Samples = rng.uniform(3, 9) * wave
        return loud
    return np.full(n, size)


@st.composite
def sources(draw: st.DrawFn) -> tuple[float, int, InputKind, Samples]:
    rate_hz = float(draw(st.integers(200, 2000) | st.sampled_from([200, 250, 256, 500, 1000, 1259.25, 2000])))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    line_hz = draw(st.sampled_from([50.0, 60.0, 150.0, 180.0, 300.0]) | st.floats(48, 62))
    n = round(rate_hz * draw(st.floats(0.1, 0.4)))
    channels = [
        np.concatenate([made(*part, n, rate_hz=rate_hz, line_hz=line_hz, rng=rng) for part in drawn])
        for drawn in draw(st.lists(st.lists(parts, min_size=4, max_size=4), min_size=1, max_size=4))
    ]
    samples = np.column_stack(channels)
    for _ in range(draw(st.integers(0, 3))):
        samples[rng.integers(len(samples)), rng.integers(samples.shape[1])] = draw(
            st.sampled_from([np.nan, np.inf, -np.inf, 1e300, 0.0])
        )
    return rate_hz, draw(st.integers(1, 300)), draw(st.sampled_from(["raw", *get_args(InputKind)])), samples


class Reference:
    """Judges channels in NumPy, its whole past moved for every chunk, and mains in every window."""

    def __init__(self, rate_hz: float, block: int, kind: InputKind, names: list[str]) -> None:
        self._names, self._raw = names, kind == "raw"
        longest = max(1, int(0.025 * rate_hz))
        hops = (n for n in range(1, longest + 1) if block % n == 0 and 2 * n > longest)
        self._hop = max(hops, default=block)
        self._n_stuck = max(16, math.ceil((0.1 if self._raw else 0.5) * rate_hz))
        self._n_still, self._n_back = max(5, math.ceil(0.02 * rate_hz)), math.ceil(0.5 * rate_hz)
        self._n_mains = round(0.2 * rate_hz)
        self._lines = {line_hz: comb(line_hz, rate_hz, self._n_mains) for line_hz in (50.0, 60.0)}
        self._past = np.full((max(self._n_stuck, self._n_mains), len(names)), np.nan)
        self._n, self._until, self._began = 0, dict[str, int](), dict[str, int]()
        self.faults: dict[str, str] = {}

    @property
    def state(self) -> tuple[int | None, bool, int]:
        """What is told beside the faults: their newest begin, whether no channel changes, samples to the next look."""
        recent = self._past[-self._n_still :]
        still = self._raw and bool((recent == recent[-1]).all())
        return max(self._began.values(), default=None), still, self._hop - self._n % self._hop

    def take(self, samples: Samples) -> Samples:
        passed, at = samples.copy(), 0
        while at < len(samples):
            part = samples[at : at + self._hop - self._n % self._hop]
            self._past = np.concatenate([self._past, part])[-len(self._past) :]
            self._n += len(part)
            if self._n % self._hop == 0:
                self._judge()
            passed[at : at + len(part), [name in self.faults for name in self._names]] = np.inf
            at += len(part)
        return passed

    def _judge(self) -> None:
        found = self._mains() | self._stuck()
        for k, name in enumerate(self._names):
            if k in found:
                self.faults[name], lasted = found[k]
                self._until[name] = self._n + self._n_back
                # At the end of the hop before, it was not seen yet.
                self._began.setdefault(name, self._n - self._hop - lasted)
            elif name in self.faults and self._n >= self._until[name]:
                del self.faults[name], self._began[name]

    def _stuck(self) -> dict[int, tuple[str, int]]:
        recent = self._past[-self._n_stuck :]
        # A missing sample is not equal to anything, itself included.
        still = (recent == recent[-1]).all(axis=0) & (self._raw | (recent[-1] >= FULL / 4))
        why = "electrode off, cable out, or amplifier saturated"
        return {int(k): (f"stays at {recent[-1, k]:g}: {why}", self._n_stuck) for k in still.nonzero()[0]}

    def _mains(self) -> dict[int, tuple[str, int]]:
        recent, found = self._past[-self._n_mains :], dict[int, tuple[str, int]]()
        swing = recent - recent.mean(axis=0)
        for line_hz, base in self._lines.items() if self._raw else ():
            line = ((base @ swing) ** 2).sum(axis=0)
            # The mean of a rectified sine is 2·√2/π of its root mean square. What is not a number is not greater.
            loud = 0.9 * np.sqrt(line / len(recent)) >= 0.1 * FULL
            for k in (loud & (line > 0.92 * (swing**2).sum(axis=0))).nonzero()[0]:
                words = f"mostly {line_hz:g} Hz mains: electrode or reference loose, or lifted off"
                found[int(k)] = words, self._n_mains
        return found


def comb(line_hz: float, rate_hz: float, n: int) -> Samples:
    """Return an orthonormal base of a frequency and its multiples below half the rate, without their mean, (m, n)."""
    turns = 2 * np.pi * np.arange(n) * line_hz / rate_hz
    waves = [wave(k * turns) for k in range(1, math.ceil(rate_hz / 2 / line_hz)) for wave in (np.cos, np.sin)]
    if not waves or 2 * len(waves) > n:
        return np.zeros((0, n))
    return np.ascontiguousarray(np.linalg.qr(np.array(waves).T)[0].T)


@given(sources(), st.lists(st.integers(0, 400), min_size=1, max_size=5).filter(any))
@example((1000.0, 100, "raw", np.full((500, 3), 127.0)), [10])
def test_every_vote_is_the_reference_s(source: tuple[float, int, InputKind, Samples], cut: list[int]) -> None:
    # Where a sum lies within its rounding of a threshold, either would be right; what is drawn does not lie there.
    rate_hz, block, kind, samples = source
    names = [f"ch{k + 1}" for k in range(samples.shape[1])]
    votes = ChannelVotes(rate_hz, block, kind, names, [FULL] * len(names))
    wanted = Reference(rate_hz, block, kind, names)
    at, before = 0, samples.copy()
    for n in cycle(cut):
        chunk = samples[at : at + n]
        with np.errstate(all="ignore"):
            expected = wanted.take(chunk)
        np.testing.assert_array_equal(votes.take(chunk), expected)
        assert votes.faults == wanted.faults
        assert (votes.began, votes.still, votes.room) == wanted.state
        at += n
        if at >= len(samples):
            break
    np.testing.assert_array_equal(samples, before)
