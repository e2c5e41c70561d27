"""Properties of the online adaptation of EMG: chunks, limits within a minute, undo, no change in a hold, replay."""

from __future__ import annotations

import math
from typing import Any, get_args

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tega.config import AdaptationSection
from tega.config.calibration import EmgMaxima
from tega.config.choose import muscle_setup
from tega.devices.base import EmgChunk
from tega.emg import InputKind
from tega.loop.emg_adaptation import MOST_GAIN, MOST_OFFSET, ChannelAdaptation, Switches, read_switches
from tega.loop.inbox.sources import BlockMeter, SourceReport
from tega.records import Adaptation, AdaptationSwitch, Intent
from tega.stages.decoders import RulesDecoder, RulesOptions

Samples = NDArray[np.float64]
RATE_HZ, TAU, FULL = 200.0, 20, 40.0
ON = AdaptationSection(on=True)
STRONG = AdaptationSection(on=True, gain_percent_per_min=50, offset_percent_per_min=10)


def maxima(kind: InputKind = "raw") -> EmgMaxima:
    return EmgMaxima(kind=kind, rate_hz=RATE_HZ, tau=TAU, channels=("ch1", "ch2"), maxima=(FULL, FULL))


def effort(shares: list[float], seconds: float, *, kind: InputKind, seed: int) -> Samples:
    """Return two channels of noise whose mean absolute value is each share of the maximum in turn."""
    rng = np.random.default_rng(seed)
    n = round(seconds * RATE_HZ)
    size = np.repeat(shares, n)[:, np.newaxis] * FULL / math.sqrt(2 / math.pi)
    samples = rng.normal(size=(len(size), 2)) * size
    return samples + 3.0 if kind == "raw" else np.abs(samples)


def meter(given: EmgMaxima, adaptation: ChannelAdaptation | None = None) -> BlockMeter:
    decoder = RulesDecoder(muscle_setup(given, "paper"), RulesOptions())
    return BlockMeter(decoder, SourceReport(), maxima=given, live=False, adaptation=adaptation)


class Run:
    def __init__(self, switches: Any, kind: InputKind = "raw", how: AdaptationSection = ON) -> None:
        self.reported: list[Adaptation | AdaptationSwitch] = []
        given = maxima(kind)
        self.adaptation = ChannelAdaptation(given, how, switches=switches, notify=self.reported.append)
        self.meter = meter(given, self.adaptation)
        self.blocks: list[Intent] = []

    def take(self, samples: Samples, cuts: list[int] | tuple[int, ...] = ()) -> Run:
        first = 0
        for part in np.split(samples, sorted({min(cut, len(samples)) for cut in cuts})):
            first += len(part)
            end_ns = round(first * 1e9 / RATE_HZ)
            self.blocks += self.meter.take(EmgChunk(end_ns, first - len(part), part))
        return self

    @property
    def changes(self) -> list[Adaptation]:
        return [one for one in self.reported if isinstance(one, Adaptation)]


@st.composite
def courses(draw: st.DrawFn) -> list[tuple[int, Switches]]:
    found, n_undone = [(0, Switches(True, draw(st.sampled_from([None, 0.5]))))], 0
    for at in sorted(draw(st.lists(st.integers(0, 8000), max_size=3))):
        n_undone += draw(st.integers(0, 2)) == 0
        target = draw(st.sampled_from([None, 0.5, 0.5, 1.0]))
        found.append((at, Switches(draw(st.integers(0, 3)) > 0, target, n_undone)))
    return found


def by_course(course: list[tuple[int, Switches]]) -> Any:
    return lambda n: [switches for at, switches in course if at <= n][-1]


@st.composite
def recordings(draw: st.DrawFn) -> tuple[InputKind, Samples]:
    """Draw 40 s of rest or a steady effort that drift, with samples that are missing."""
    kind = draw(st.sampled_from(get_args(InputKind)))
    first = draw(st.sampled_from([0.04, 0.3, 0.5, 0.6]))
    times = draw(st.floats(0.5, 2.5))
    shares = [*(first * times**k for k in (0, 0.3, 0.6, 1)), draw(st.sampled_from([0.02, 0.9]))]
    samples = effort(shares, 8.0, kind=kind, seed=draw(st.integers(0, 99)))
    for at in draw(st.lists(st.integers(0, len(samples) - 1), max_size=2)):
        samples[at, draw(st.integers(0, 1))] = draw(st.sampled_from([np.nan, np.inf, -np.inf, 1e300]))
    return kind, samples


@settings(max_examples=settings().max_examples // 2)
@given(recordings(), courses(), st.lists(st.integers(0, 8000), max_size=12), st.floats(0, 8), st.floats(0, 2))
def test_limits_and_switches_are_kept_however_samples_are_cut_and_in_a_replay(
    recording: tuple[InputKind, Samples],
    course: list[tuple[int, Switches]],
    cuts: list[int],
    gain: float,
    offset: float,
) -> None:
    kind, samples = recording
    how = AdaptationSection(on=True, gain_percent_per_min=gain, offset_percent_per_min=offset)
    run = Run(by_course(course), kind, how).take(samples)
    read = [one for one in run.reported if isinstance(one, AdaptationSwitch)]
    for again, at in ((by_course(course), cuts), (read_switches(read), [137, 4001])):
        same = Run(again, kind, how).take(samples, at)
        assert (same.blocks, same.reported) == (run.blocks, run.reported)
    gains, offsets = np.ones(2), np.zeros(2)
    moved_gain, moved_offset = np.zeros(2), np.zeros(2)  # the whole recording is shorter than a minute
    for change in run.changes:
        now = np.array(change.gains), np.array(change.offsets)
        if change.why in {"rest", "target"}:
            switches = by_course(course)(change.n_samples)
            assert switches.allowed
            assert switches.n_undone % 2 == 0
            moved_gain += np.abs(np.log(now[0] / gains))
            moved_offset += np.abs(now[1] - offsets) / FULL
        else:
            assert (change.gains, change.offsets) == ((1.0, 1.0), (0.0, 0.0))
        gains, offsets = now
        assert (np.abs(np.log(gains)) <= math.log(MOST_GAIN) + 1e-12).all()
        assert ((offsets >= 0) & (offsets <= MOST_OFFSET * FULL + 1e-12)).all()
    assert (moved_gain <= math.log1p(gain / 100) + 1e-9).all()
    assert (moved_offset <= offset / 100 + 1e-9).all()


@settings(max_examples=settings().max_examples // 3)
@given(recordings())
def test_undone_samples_are_as_they_came(recording: tuple[InputKind, Samples]) -> None:
    kind, samples = recording
    n_before = 200 * TAU
    run = Run(lambda n: Switches(allowed=True, n_undone=int(n >= n_before)), kind)
    run.take(samples[:n_before])
    rest = samples[n_before:]
    for at in range(0, len(rest) - TAU + 1, TAU):
        part = rest[at : at + TAU]
        made = run.adaptation.take(part)
        assert made is part  # the very object, so not a bit is other
        run.adaptation.decoded([], 0)


def test_sixty_seconds_later_there_is_room_again() -> None:
    samples = effort([0.02, *[0.1] * 11], 10.0, kind="rectified", seed=1)
    run = Run(lambda _n: Switches(allowed=True), "rectified").take(samples)
    offsets = np.array([0.0, *(change.offsets[0] / FULL for change in run.changes)])
    at = np.array([change.n_samples for change in run.changes])
    steps = np.abs(np.diff(offsets))
    for k, end in enumerate(at):
        within = at[: k + 1] > end - 60 * RATE_HZ
        assert steps[: k + 1][within].sum() <= 0.02 + 1e-12
    assert offsets[-1] > 0.03  # more than one minute's share


@pytest.mark.parametrize("kind", ["raw", "rectified"])
def test_a_rest_that_rises_and_an_effort_that_weakens_are_followed(kind: InputKind) -> None:
    rests = effort([0.05, 0.05, 0.1, 0.1, 0.1, 0.1], 10.0, kind=kind, seed=2)
    run = Run(lambda _n: Switches(allowed=True, target=0.0), kind, STRONG).take(rests)
    assert {change.why for change in run.changes} == {"rest"}
    assert 0.02 * FULL < run.adaptation.offsets[0] < 0.08 * FULL
    efforts = effort([0.6, 0.6, 0.5, 0.5, 0.5, 0.5], 10.0, kind=kind, seed=3)
    run = Run(lambda _n: Switches(allowed=True, target=0.5), kind, STRONG).take(efforts)
    assert {change.why for change in run.changes} == {"target"}
    assert run.adaptation.gains == pytest.approx([1.2, 1.2], rel=0.06)


@pytest.mark.parametrize(("share", "seen"), [(0.3, 0.25), (0.8, 0.75)])
@pytest.mark.parametrize("target", [0.25, 0.75])
def test_a_target_is_believed_where_the_decoder_s_level_is_its_closure(share, seen, target) -> None:
    efforts = effort([share] * 4, 10.0, kind="raw", seed=3)
    run = Run(lambda _n: Switches(allowed=True, target=target), "raw", STRONG).take(efforts)
    assert bool(run.changes) == (target == seen)


def test_a_target_that_the_decoder_does_not_see_is_not_believed() -> None:
    efforts = effort([0.9] * 4, 10.0, kind="rectified", seed=3)
    run = Run(lambda n: Switches(allowed=True, target=0.3 if n % 4000 < 3000 else 1.0), "rectified")
    run.take(efforts)
    assert not [change for change in run.changes if change.why == "target" and change.gains[0] < 1]
    assert not run.adaptation.adapted


def test_off_nothing_is_made_and_the_default_is_off() -> None:
    assert AdaptationSection().on is False
    samples = effort([0.02, 0.1, 0.9], 10.0, kind="raw", seed=4)
    run = Run(lambda _n: Switches(), "raw").take(samples)
    assert run.reported == []
    chunk = EmgChunk(round(len(samples) * 1e9 / RATE_HZ), 0, samples)
    assert meter(maxima()).take(chunk) == run.blocks
