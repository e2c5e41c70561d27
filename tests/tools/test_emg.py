"""The EMG chain: design, conditioning, lost samples, bad input."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tega.emg import BlockMean, ButterworthLowpass, GraspIntent, channel_maxima, fuse_levels, grasp_level
from tega.emg.votes import ChannelVotes
from tega.errors import CalibrationError, DtypeError, InvalidValueError, ShapeError

NOT_POSITIVE = (0.0, -1.0, np.nan, np.inf)


def test_raw_input_loses_its_offset_and_is_rectified() -> None:
    signal = pytest.importorskip("scipy.signal", reason="scipy is not installed")
    rng = np.random.default_rng(1)
    samples = 2048 + 300 * rng.normal(size=(900, 3))
    high, low = (
        signal.butter(4, hz, btype, fs=1000, output="sos") for hz, btype in ((20, "high"), (50, "low"))
    )
    start = signal.sosfilt_zi(high)[:, :, np.newaxis] * samples[0]
    swing, _ = signal.sosfilt(high, samples, axis=0, zi=start)
    start = signal.sosfilt_zi(low)[:, :, np.newaxis] * np.abs(swing[0])
    smooth, _ = signal.sosfilt(low, np.abs(swing), axis=0, zi=start)
    means = smooth.reshape(9, 100, 3).mean(axis=1)
    got = channel_maxima(samples, 1000, tau=100, percentile=100)
    np.testing.assert_allclose(got, means.max(axis=0), rtol=1e-12)


@pytest.mark.parametrize("rate_hz", [200.0, 1e3, 1e5, 1e6])
def test_mid_rail_counts_are_rest_from_the_first_block(rate_hz: float) -> None:
    intent = GraspIntent(rate_hz, [1.0], tau=20, preset="paper")
    assert intent.process(np.full(4000, 2048.0)).tolist() == [1] * 200


def test_a_lost_channel_leaves_the_vote_after_100_ms_and_returns() -> None:
    rest, full = np.full((20, 3), 0.01), np.full((20, 3), 1.3)
    lost = np.tile([np.nan, 1.3, 1.3], (19, 1))
    intent = GraspIntent(200, [1.0] * 3, tau=20, kind="envelope", preset="paper")
    intent.process(rest)
    assert intent.process(lost).size == 0
    assert not intent.bad_channels
    intent.process(np.array([[np.inf, 1.3, 1.3]]))
    assert intent.bad_channels == (0,)
    assert intent.levels.tolist() == [[0, 5, 5]]
    assert intent.held_samples.tolist() == [20, 0, 0]
    intent.process(full)
    assert len(intent.bad_channels) == 0
    assert intent.process(full).tolist() == [5]
    assert intent.levels.tolist() == [[5, 5, 5]]
    assert not intent.holding
    assert intent.process(np.full((20, 3), np.inf)).tolist() == [5]
    assert intent.holding


def test_infinities_and_huge_numbers_do_not_poison_the_filter() -> None:
    lowpass = ButterworthLowpass(200, channels=1)
    out = lowpass.process([1.0, np.inf, -np.inf, 1.7e308, np.nan, 1.0])
    np.testing.assert_allclose(out[:, 0], 1.0, rtol=1e-14)
    assert lowpass.held_samples.tolist() == [4]


def test_arrays_of_any_layout_and_real_type_are_taken() -> None:
    rng = np.random.default_rng(2)
    counts = rng.integers(0, 4096, size=(64, 3))
    wanted = ButterworthLowpass(1000).process(counts.astype(np.float64))
    wide = np.zeros((64, 6))
    wide[:, ::2] = counts
    frozen = counts.astype(np.float64)
    frozen.flags.writeable = False
    layouts = (counts, counts.astype(np.uint16), counts.astype(np.float32), wide[:, ::2], frozen)
    for samples in (*layouts, np.asfortranarray(frozen), frozen[::-1][::-1]):
        np.testing.assert_array_equal(ButterworthLowpass(1000).process(samples), wanted)


def test_nothing_in_gives_nothing_out() -> None:
    assert ButterworthLowpass(1000).process(np.empty((0, 3))).shape == (0, 3)
    assert BlockMean(4, channels=2).process(np.empty((0, 2))).shape == (0, 2)
    intent = GraspIntent(1000, [2.0, 4.0], tau=10)
    assert intent.process(np.empty((0, 2))).shape == (0,)
    assert intent.levels.shape == (0, 2)
    assert intent.maxima.tolist() == [1.6, 3.2]  # live takes four fifths
    # Left out, the channels are those of the first call.
    blocks = BlockMean(2)
    assert blocks.channels is None
    assert blocks.process([[1.0, 2.0], [3.0, 4.0]]).tolist() == [[2.0, 3.0]]
    assert blocks.channels == 2
    with pytest.raises(ShapeError, match="3 channels, expected 2"):
        blocks.process(np.zeros((1, 3)))


INTENT: dict[str, Any] = {"rate_hz": 200, "maxima": [1.0], "tau": 20}
LOWPASS: dict[str, Any] = {"rate_hz": 200.0}
MAXIMA: dict[str, Any] = {"samples": np.full((400, 2), 512.0), "rate_hz": 200, "tau": 20}
GAP = np.where(np.arange(400)[:, np.newaxis] * [0, 1] == 7, np.nan, 1.0)
MASKED = np.ma.masked_invalid(GAP)
OTHER_CHANNELS = tuple(np.zeros(shape) for shape in ((4, 2), (4, 4), (4, 0)))
OTHER_SHAPES = tuple(np.zeros(shape) for shape in ((4,), (2, 3, 1), ()))
OTHER_TYPES = tuple(np.zeros((4, 3), kind) for kind in ("c16", "?", "O", "U3"))
PROCESSES = (ButterworthLowpass(200).process, GraspIntent(200, [1.0] * 3, tau=20).process)
NO_CUTOFF = r"cutoff_hz = .* rate_hz = "
REFUSED: list[tuple[Any, dict[str, Any], str, tuple[Any, ...], type[Exception], str]] = [
    (ButterworthLowpass, {}, "rate_hz", (0.0, np.inf), InvalidValueError, "rate_hz"),
    (ButterworthLowpass, LOWPASS, "order", (9,), InvalidValueError, "order"),
    (ButterworthLowpass, LOWPASS, "channels", (-1, 0, 1025), InvalidValueError, "channels"),
    (ButterworthLowpass, LOWPASS, "cutoff_hz", (0.0, 99.9999, np.nan), InvalidValueError, NO_CUTOFF),
    (BlockMean, {}, "tau", (-5, 0, 10_000_001), InvalidValueError, "tau"),
    (GraspIntent, INTENT, "tau", (-5, 0, 10_000_001), InvalidValueError, "tau"),
    (GraspIntent, INTENT, "kind", ("cooked",), InvalidValueError, "kind"),
    (GraspIntent, INTENT, "preset", ("paperback",), InvalidValueError, "preset"),
    (GraspIntent, INTENT, "rate_hz", (80,), InvalidValueError, r"cutoff_hz = 50 Hz .* rate_hz = 80 Hz"),
    (GraspIntent, INTENT, "maxima", ([[1.0, 2.0]],), ShapeError, "maxima"),
    (GraspIntent, INTENT, "maxima", tuple([1.0, m] for m in NOT_POSITIVE), CalibrationError, "channel 2"),
    (fuse_levels, {}, "levels", ([], np.empty((2, 0))), InvalidValueError, "empty"),
    (
        fuse_levels,
        {},
        "levels",
        ([1.0, 2.0], MASKED, np.full((2, 3), np.nan)),
        DtypeError,
        "levels are float64",
    ),
    (fuse_levels, {}, "levels", tuple([1, n, 2] for n in (-1, 0, 6, 300)), InvalidValueError, "level = "),
    (grasp_level, {"value": 1.0}, "maximum", NOT_POSITIVE, InvalidValueError, "maximum"),
    (channel_maxima, MAXIMA, "tau", (20,), CalibrationError, "maximum of channel 1"),
    (channel_maxima, MAXIMA, "samples", (np.ones((19, 2)),), CalibrationError, "19 samples"),
    (channel_maxima, MAXIMA, "samples", (GAP, MASKED), CalibrationError, "sample 7 of channel 2"),
    (channel_maxima, MAXIMA, "samples", (np.empty((400, 0)),), InvalidValueError, "channels"),
    (channel_maxima, MAXIMA, "percentile", (-1.0, 100.1, np.nan), InvalidValueError, "percentile"),
    (
        ChannelVotes(200, 20, "envelope", ["a"], [1.0]).take,
        {},
        "samples",
        OTHER_CHANNELS,
        ShapeError,
        "have shape",
    ),
    *((one, {}, "samples", OTHER_CHANNELS, ShapeError, "channels, expected 3") for one in PROCESSES),
    *((one, {}, "samples", OTHER_SHAPES, ShapeError, r"expected \(n, 3\)") for one in PROCESSES),
    *((one, {}, "samples", OTHER_TYPES, DtypeError, "expected float64") for one in PROCESSES),
]


@pytest.mark.parametrize(("call", "rest", "name", "values", "error", "text"), REFUSED)
def test_what_makes_no_sense_is_refused(
    call: Any, rest: dict[str, Any], name: str, values: tuple[Any, ...], error: type[Exception], text: str
) -> None:
    for value in values:
        with pytest.raises(error, match=text):
            call(**rest | {name: value})
