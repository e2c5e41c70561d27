"""The votes of EMG channels are those of the reference, whatever comes and however it is cut."""

from __future__ import annotations

from itertools import cycle
from typing import get_args

import numpy as np
from hypothesis import example, given
from hypothesis import strategies as st
from numpy.typing import NDArray

from reference import emg_votes as reference
from tega.emg import InputKind
from tega.emg.votes import ChannelVotes

Samples = NDArray[np.float64]
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
    """Draw a source of 1 to 4 channels: its rate, samples a block, kind, and samples of 0.4 to 1.6 s."""
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


@given(sources(), st.lists(st.integers(0, 400), min_size=1, max_size=5).filter(any))
@example((1000.0, 100, "raw", np.full((500, 3), 127.0)), [10])
def test_every_vote_is_the_reference_s(source: tuple[float, int, InputKind, Samples], cut: list[int]) -> None:
    """Faults, words, infinite samples and what is told beside them.

    Both add up in floating point, in another order: where a sum lies within its rounding of a threshold, either would
    be right. What is drawn here does not lie there.
    """
    rate_hz, block, kind, samples = source
    names = [f"ch{k + 1}" for k in range(samples.shape[1])]
    votes = ChannelVotes(rate_hz, block, kind, names, [FULL] * len(names))
    wanted = reference.ChannelVotes(rate_hz, block, kind, names, [FULL] * len(names))
    at, before = 0, samples.copy()
    for n in cycle(cut):
        chunk = samples[at : at + n]
        with np.errstate(all="ignore"):
            expected = wanted.take(chunk)
        np.testing.assert_array_equal(votes.take(chunk), expected)
        assert votes.faults == wanted.faults
        assert (votes.began, votes.still, votes.room) == (wanted.began, wanted.still, wanted.room)
        at += n
        if at >= len(samples):
            break
    np.testing.assert_array_equal(samples, before)
