"""Contact metrics: the print at its edges, borrowed memory, refused input, real presses."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from tega.errors import DtypeError, InvalidValueError, ShapeError, TegaError
from tega.tactile import ContactMetrics, contact_metrics, contact_metrics_many, read_contact, read_contacts

FLAT = np.full((8, 10, 3), 100, np.uint8)


def test_subtraction_does_not_wrap() -> None:
    darker = np.full_like(FLAT, 90)
    m = contact_metrics(darker, FLAT)
    assert m.peak == -10.0
    assert not m.in_contact


def test_one_pixel_has_a_centroid_no_spread_and_no_pixel_above_its_own_value() -> None:
    m = contact_metrics(np.full((1, 1, 3), 30, np.uint8), np.zeros((1, 1, 3), np.uint8))
    assert m == ContactMetrics(30.0, (0.0, 0.0), 0.0, 30.0, 0, 0.0, 30.0, (0, 0), in_contact=True)


def test_a_uniform_step_has_no_intensity_spread_so_no_area() -> None:
    m = contact_metrics(FLAT + 20, FLAT, spread="intensity")
    assert (m.spread, m.threshold, m.eda, m.cci, m.in_contact) == (0.0, 20.0, 0, 0.0, True)


def test_no_difference_is_no_contact_with_nan_where_undefined() -> None:
    m = contact_metrics(FLAT, FLAT)
    assert (m.mass, m.eda, m.cci, m.in_contact) == (0.0, 0, 0.0, False)
    assert all(math.isnan(v) for v in (*m.centroid_xy, m.spread, m.threshold))


def test_a_centroid_between_two_pixels_takes_the_later_one() -> None:
    frame = np.zeros((1, 2, 3), np.uint8)
    frame[0, 0] = frame[0, 1] = 100
    m = contact_metrics(frame, np.zeros_like(frame), factor=0.0)
    assert m.centroid_xy == (0.5, 0.0)
    assert m.threshold == 100.0


def test_a_centroid_outside_the_image_takes_the_clamped_pixel() -> None:
    frame, baseline = np.full((1, 3, 3), 100, np.uint8), np.full((1, 3, 3), 100, np.uint8)
    frame[0, 2] += 50
    frame[0, 0] -= 40
    m = contact_metrics(frame, baseline, factor=0.0, spread="intensity")
    assert m.centroid_xy == (10.0, 0.0)
    assert m.threshold == 50.0


def test_weights_name_colours_whatever_the_byte_order() -> None:
    frame, baseline = np.zeros((2, 2, 3), np.uint8), np.zeros((2, 2, 3), np.uint8)
    frame[..., 2] = 100
    assert contact_metrics(frame, baseline, weights=(1, 0, 0), order="bgr").peak == 100.0
    assert contact_metrics(frame, baseline, weights=(1, 0, 0), order="rgb").peak == 0.0


def test_the_largest_frame_does_not_overflow() -> None:
    frame = np.full((4096, 4096, 3), 255, np.uint8)
    m = contact_metrics(frame, np.zeros_like(frame))
    assert m.centroid_xy == (2047.5, 2047.5)
    assert m.spread == pytest.approx(math.sqrt((4096**2 - 1) / 6), rel=1e-15)
    assert m.eda == 4096**2
    assert read_contact(frame, np.zeros_like(frame), reading="paper").eda == 4096**2


def test_frames_are_read_where_they_lie() -> None:
    frame, baseline = FLAT.copy(), FLAT.copy()
    view = frame[::2, ::2]
    before = contact_metrics(view, baseline[::2, ::2]).peak
    frame[2, 2] += 77
    assert (before, contact_metrics(view, baseline[::2, ::2]).peak) == (0.0, 77.0)


@pytest.mark.parametrize("n_frames", [1, 4, 40])
def test_many_frames_in_one_call_read_as_one_by_one(n_frames: int) -> None:
    rng = np.random.default_rng(n_frames)
    frames = rng.integers(0, 256, (n_frames, 120, 250, 3), dtype=np.uint8)
    baselines = rng.integers(0, 256, (n_frames, 120, 250, 3), dtype=np.uint8)
    assert contact_metrics_many(frames, baselines[0], difference="absolute") == [
        contact_metrics(frame, baselines[0], difference="absolute") for frame in frames
    ]
    for reading in ("paper", "live"):
        np.testing.assert_equal(
            read_contacts(list(frames), list(baselines), reading=reading),
            [read_contact(f, b, reading=reading) for f, b in zip(frames, baselines, strict=True)],
        )


def test_many_frames_of_different_sizes_and_none() -> None:
    sizes = [(8, 10), (5, 300), (1, 1)]
    frames = [np.full((*size, 3), 50, np.uint8) for size in sizes]
    still = [np.zeros_like(frame) for frame in frames]
    assert [m.eda for m in contact_metrics_many(frames, still)] == [80, 1500, 0]
    assert contact_metrics_many([], []) == read_contacts([], []) == []
    with pytest.raises(ShapeError, match="2 baselines for 3 frames; give one for all frames"):
        read_contacts(frames, still[:2])
    with pytest.raises(ShapeError, match="baseline is 8x10"):
        read_contacts(frames, still[0])


@pytest.mark.parametrize("read", [contact_metrics, read_contact])
@pytest.mark.parametrize(
    ("frame", "error", "words"),
    [
        (FLAT.astype(np.float64), DtypeError, ["frame", "float64", "uint8", "scaled to 0..255"]),
        (np.full(FLAT.shape, np.nan), DtypeError, ["frame", "float64"]),
        (FLAT.astype(np.int16), DtypeError, ["frame", "int16"]),
        (FLAT[..., 0], ShapeError, ["frame", "(8, 10)", "(height, width, 3)"]),
        (FLAT[..., :2], ShapeError, ["frame", "2 channels", "3"]),
        (FLAT[:0], ShapeError, ["0x10", "1 to 4096"]),
        (np.zeros((1, 4097, 3), np.uint8), ShapeError, ["1x4097", "4096"]),
        (FLAT[:, :9], ShapeError, ["baseline is 8x10", "frame is 8x9", "same sensor"]),
        (FLAT.tolist(), DtypeError, ["frame is a list", "numpy"]),
        (None, DtypeError, ["frame is a NoneType"]),
    ],
)
def test_what_is_not_a_frame_is_refused_by_name(read, frame, error, words) -> None:
    with pytest.raises(error) as caught:
        read(frame, FLAT)
    assert isinstance(caught.value, TegaError)
    for word in words:
        assert word in str(caught.value)


def test_a_bad_baseline_is_called_baseline() -> None:
    with pytest.raises(DtypeError, match="baseline has dtype float32"):
        contact_metrics(FLAT, FLAT.astype(np.float32))


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"weights": (0.3, 0.3, 0.3)}, ["0.3", "add up to 0.9", "not renormalised"]),
        ({"weights": (math.nan, 0.5, 0.5)}, ["weights", "NaN", "finite"]),
        ({"factor": math.inf}, ["factor", "finite"]),
        ({"order": "gbr"}, ["order", "'gbr'", "'bgr' or 'rgb'"]),
        ({"difference": "abs"}, ["difference", "'abs'", "'signed'"]),
        ({"spread": "px"}, ["spread", "'px'", "'spatial'"]),
        ({"centroid_value": "cubic"}, ["centroid_value", "'cubic'"]),
        ({"gate": (300.0, 30)}, ["noise_floor", "300", "0 to 255"]),
    ],
)
def test_options_out_of_range_are_refused_by_name(options, words) -> None:
    with pytest.raises(InvalidValueError) as caught:
        contact_metrics(FLAT, FLAT, **options)
    for word in words:
        assert word in str(caught.value)


def test_an_unknown_reading_is_refused_by_name() -> None:
    with pytest.raises(InvalidValueError, match="reading = 'best' is not known; use 'paper' or 'live'"):
        read_contact(FLAT, FLAT, reading="best")  # type: ignore[arg-type]


def test_on_real_presses_the_print_says_whole_image_and_the_paper_preset_does_not(recordings: Path) -> None:
    cv2 = pytest.importorskip("cv2", reason="needs the extra tega[lab]")
    folder = recordings / "digit" / "digit_ball_D20641"
    baseline = cv2.imread(str(folder / "background.png"))
    frames = [cv2.imread(str(folder / f"frame_{k}.png")) for k in range(31)]
    for frame in frames:
        for difference in ("absolute", "rectified"):
            assert contact_metrics(frame, baseline, difference=difference).eda == frame[..., 0].size
    areas = [read_contact(frame, baseline, reading="paper").eda for frame in frames]
    assert 12_000 < min(areas) < max(areas) < 24_000
