"""Channels that measure no muscle have no vote, and none that measures one loses it."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from tega.config.calibration import EmgMaxima
from tega.devices.base import EmgChunk
from tega.emg import InputKind, channel_maxima
from tega.emg.votes import ChannelVotes
from tega.errors import ShapeError
from tega.loop.inbox.sources import BlockMeter, SourceReport
from tega.records import Intent
from tega.stages.base import MuscleSetup
from tega.stages.decoders import RulesDecoder, RulesOptions

RATE_HZ, TAU = 250.0, 25
RAIL = 187_500.0


def squeeze(n: int, *, seed: int = 1, size: float = 100.0) -> NDArray[np.float64]:
    return np.random.default_rng(seed).normal(0, size, (n, 3))


def hum(n: int, *, size: float = 400.0, line_hz: float = 50.0) -> NDArray[np.float64]:
    rng = np.random.default_rng(5)
    turns = 2 * np.pi * line_hz * np.arange(n) / RATE_HZ
    wave: NDArray[np.float64] = rng.normal(0, 10, (n, 3)) + size * np.sin(turns)[:, None]
    return wave


def levels(
    samples: NDArray[np.float64], *, preset: str = "live", cut: Sequence[int] = (4,)
) -> tuple[list[Intent], SourceReport]:
    """Decode samples as a run does."""
    maximum = float(channel_maxima(squeeze(2000)[:, :1], RATE_HZ, tau=TAU)[0])
    maxima = EmgMaxima(kind="raw", rate_hz=RATE_HZ, tau=TAU, channels=("a", "b", "c"), maxima=(maximum,) * 3)
    setup = MuscleSetup("raw", RATE_HZ, TAU, maxima.channels, maxima.maxima, preset)  # type: ignore[arg-type]
    report = SourceReport()
    meter = BlockMeter(RulesDecoder(setup, RulesOptions()), report, maxima=maxima, live=False)
    blocks, at, k = list[Intent](), 0, 0
    while at < len(samples):
        n = cut[k % len(cut)]
        blocks += meter.take(EmgChunk(0, at, samples[at : at + n]))
        at, k = at + n, k + 1
    return blocks, report


@pytest.mark.parametrize("preset", ["paper", "live"])
@pytest.mark.parametrize("begin", [500, 509, 524])
@pytest.mark.parametrize("fault", ["rail", "flat", "hum", "hum 60"])
def test_a_fault_of_every_channel_keeps_the_level_before_it(fault: str, begin: int, preset: str) -> None:
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


def test_a_vote_is_lost_by_one_channel_alone_and_comes_back() -> None:
    samples = squeeze(1500)
    samples[500:750, 1] = RAIL
    blocks, report = levels(samples)
    lost = [k for k, block in enumerate(blocks) if block.channels[1] == 0]
    assert lost == list(range(lost[0], lost[-1] + 1))
    assert 20 <= lost[0] <= 22
    # Half a second after it is over, and a tenth for the filters to start afresh.
    assert 34 <= lost[-1] <= 37
    assert all(block.channels[0] > 0 < block.channels[2] for block in blocks)
    assert {block.level for block in blocks[5:]} <= {4, 5}
    assert report.faults == ()


def _requested(intents: list[Intent]) -> list[tuple[object, ...]]:
    return [(one.channels, one.level, one.closure, one.confidence, one.activity) for one in intents]


@settings(max_examples=20)
@given(cut=st.lists(st.integers(1, 60), min_size=1, max_size=6), fault=st.sampled_from(["rail", "hum"]))
def test_the_votes_do_not_depend_on_how_samples_are_cut(cut: list[int], fault: str) -> None:
    samples = squeeze(900)
    samples[310:560] = RAIL if fault == "rail" else hum(250)
    samples[600:640, 1] = np.nan
    whole = _requested(levels(samples, cut=(900,))[0])
    assert _requested(levels(samples, cut=cut)[0]) == whole


def test_mains_that_move_nothing_are_left_alone() -> None:
    blocks, report = levels(np.concatenate([squeeze(500), hum(500, size=5.0)]))
    assert report.faults == ()
    assert blocks[-1].level == 1


def test_a_coarse_envelope_may_rest_and_may_not_stick_above() -> None:
    votes = ChannelVotes(RATE_HZ, TAU, "envelope", ["a"], [100.0])
    votes.take(np.full((500, 1), 3.0))
    assert votes.faults == {}
    votes.take(np.full((150, 1), 1023.0))
    assert "stays at 1023" in votes.faults["a"]
    with pytest.raises(ShapeError):
        votes.take(np.zeros((5, 2)))


def read_all(folder: Path) -> list[tuple[str, InputKind, float, NDArray[np.float64]]]:
    """Every recording of people there is, with what it holds."""
    io = pytest.importorskip("scipy.io")
    folder = folder / "emg"
    found: list[tuple[str, InputKind, float, NDArray[np.float64]]] = []

    def matrices(name: str) -> list[tuple[str, NDArray[np.float64]]]:
        paths = sorted(folder.glob(f"{name}/*.mat"))
        return [(path.name, io.loadmat(path)["emg"].astype(float)) for path in paths]

    found += [(name, "raw", 200.0, samples) for name, samples in matrices("my_thesis")]
    found += [(name, "envelope", 500.0, samples) for name, samples in matrices("unibo_inail")]
    for name in ("longterm_myo", "libemg_tests"):
        parts = [np.loadtxt(path, delimiter=",") for path in sorted(folder.glob(f"{name}/*.csv"))]
        found.append((name, "raw", 200.0, np.concatenate(parts)))
    found.append(("biosppy", "raw", 1000.0, np.loadtxt(folder / "biosppy/emg_1.txt").reshape(-1, 1)))
    return found


def test_no_channel_of_a_person_loses_its_vote(recordings: Path) -> None:
    """Squeezes that clip among them (3.7 % of their samples), and the mains between the bursts of one recording."""
    n_channels = 0
    for name, kind, rate_hz, samples in read_all(recordings):
        tau = round(rate_hz / 10)
        maxima = channel_maxima(samples, rate_hz, tau=tau, kind=kind)
        names = [f"ch{k + 1}" for k in range(samples.shape[1])]
        votes = ChannelVotes(rate_hz, tau, kind, names, maxima.tolist())
        for at in range(0, len(samples), tau):
            votes.take(samples[at : at + tau])
            assert votes.faults == {}, f"{name} at {at / rate_hz:.1f} s"
        n_channels += len(names)
    assert n_channels == 6 * 8 + 2 * 4 + 8 + 8 + 1
