"""Contact metrics: the print at its edges, borrowed memory, refused input, real presses."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from tega.errors import DtypeError, InvalidValueError, ShapeError, TegaError
from tega.tactile import contact_metrics, contact_metrics_many, read_contact, read_contacts

FLAT = np.full((8, 10, 3), 100, np.uint8)


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
    with pytest.raises(error, match="baseline"):
        read(FLAT, frame)
    assert isinstance(caught.value, TegaError)
    for word in words:
        assert word in str(caught.value)


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
