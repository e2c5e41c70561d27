"""Contact metrics: many frames, refused input, rest taken anew, millimetres, real presses."""

from __future__ import annotations

import math
import pickle
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from reference.recordings import baseline as still
from reference.recordings import pressed as dented
from tega.config.choose import preset_metric
from tega.emg import Preset
from tega.errors import DtypeError, InvalidValueError, ShapeError, TegaError
from tega.loop.adapting import REZERO_SEAT, FingerRezero, RezeroKey
from tega.loop.inbox.sources import SourceReport
from tega.records import Button, Contact
from tega.records.bus import Bus
from tega.stages.base import Metric
from tega.tactile import (
    contact_mask,
    contact_metrics,
    contact_metrics_many,
    pressure_map,
    read_contact,
    read_contacts,
)
from tega.tactile.tracker import GelLight, TouchTracker, TrackedContact, nominal_light

FLAT = np.full((8, 10, 3), 100, np.uint8)
imread: Any = cv2.imread


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
    frames = [np.full((*size, 3), 50, np.uint8) for size in ((8, 10), (5, 300), (1, 1))]
    still = [np.zeros_like(frame) for frame in frames]
    assert [m.eda for m in contact_metrics_many(frames, still)] == [80, 1500, 0]
    assert contact_metrics_many([], []) == read_contacts([], []) == []
    with pytest.raises(ShapeError, match="2 baselines for 3 frames; give one for all frames"):
        read_contacts(frames, still[:2])
    for one, said in ((still[0], "baseline is 8x10"), (still[0][..., 0], r"baseline has shape \(8, 10\)")):
        with pytest.raises(ShapeError, match=said):
            read_contacts(frames, one)


@pytest.mark.parametrize("read", [contact_metrics, read_contact])
@pytest.mark.parametrize(
    ("frame", "error", "words"),
    [
        (FLAT.astype(np.float64), DtypeError, ["frame", "float64", "uint8", "scaled to 0..255"]),
        (np.ma.masked_equal(FLAT, FLAT[0, 0, 0]), InvalidValueError, ["frame has", "masked values; fill"]),
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
    assert all(word in str(caught.value) for word in words)


@pytest.mark.parametrize(
    ("options", "words"),
    [
        ({"weights": [0.3, 0.3, 0.3]}, ["0.3", "add up to 0.9", "not renormalised"]),
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
    assert all(word in str(caught.value) for word in words)
    for call in (
        lambda: contact_metrics(FLAT, FLAT, weights=(1.0,)),  # type: ignore[arg-type]
        lambda: TouchTracker(FLAT, noise=[1.0]),
    ):
        with pytest.raises(ShapeError, match="1 numbers, wanted 3"):
            call()
    with pytest.raises(InvalidValueError, match="reading = 'best' is not known; use 'paper' or 'live'"):
        read_contact(FLAT, FLAT, reading="best")  # type: ignore[arg-type]


def test_on_real_presses_the_print_says_whole_image_and_the_paper_preset_does_not(recordings: Path) -> None:
    folder = recordings / "digit" / "digit_ball_D20641"
    baseline = imread(str(folder / "background.png"))
    frames = [imread(str(folder / f"frame_{k}.png")) for k in range(31)]
    for frame in frames:
        for difference in ("absolute", "rectified"):
            assert contact_metrics(frame, baseline, difference=difference).eda == frame[..., 0].size
    areas = [read_contact(frame, baseline, reading="paper").eda for frame in frames]
    assert 12_000 < min(areas) < max(areas) < 24_000


STILL = np.full((320, 240, 3), 120, np.uint8)


def marked() -> np.ndarray:
    frame = STILL.copy()
    frame[140:180, 100:140, 0] += 40
    frame[140:180, 100:140, 2] -= 40
    return frame


def seen(metric: Metric, frames: int, from_ns: int = 0) -> Contact:
    for k in range(frames):
        contact = metric.update(marked(), from_ns + k * 16_666_667)
    return contact


def test_a_dent_that_stays_is_no_contact_after_a_request() -> None:
    bus, report, metric = Bus(), SourceReport(), preset_metric("live", STILL)
    rezero = FingerRezero(bus, metric, report)
    assert seen(metric, 30).in_contact
    assert not rezero.before_picture()
    RezeroKey(bus).press()
    assert rezero.before_picture()
    assert not rezero.before_picture()  # once a request
    assert not seen(metric, 30, 10**9).in_contact
    assert (report.n_rezeroed, report.n_rezero_refused) == (1, 0)


@pytest.mark.parametrize("preset", ["live", "paper"])
def test_a_request_is_refused_under_load_and_by_a_metric_without_such_a_baseline(preset: Preset) -> None:
    bus, report, metric = Bus(), SourceReport(), preset_metric(preset, STILL)
    rezero = FingerRezero(bus, metric, report)
    seen(metric, 30)
    metric.loaded = preset == "live"
    bus.publish(Button(seat=REZERO_SEAT, t_ns=0, seq=0, button="page", pressed=True))
    assert not rezero.before_picture()
    assert (report.n_rezeroed, report.n_rezero_refused) == (0, 1)
    assert seen(metric, 5, 10**9).in_contact


def pressed(light: GelLight | None, shape: tuple[int, int]) -> TrackedContact:
    gel = np.full((*shape, 3), 90, np.uint8)
    tracker, frame = TouchTracker(gel, light=light), gel.copy()
    frame[100:160, 80:140] += 40
    tracker.update(frame)
    contact = tracker.update(frame)
    assert contact.in_contact
    return contact


@pytest.mark.parametrize("shape", [(320, 240), (240, 320), (480, 640)])
def test_middle_spread_and_area_are_scaled_alike(shape: tuple[int, int]) -> None:
    light = nominal_light()._replace(mm_per_px=0.06)
    contact = pressed(light, shape)
    # The scale is that of a picture of 320 x 240.
    mm = 0.06 * 400 / np.hypot(*shape)
    assert contact.area_mm2 == pytest.approx(contact.eda * mm**2)
    assert contact.spread_mm == pytest.approx(contact.spread * mm)
    assert contact.centroid_mm == pytest.approx([(at + 0.5) * mm for at in contact.centroid_xy])
    both = [contact, TouchTracker(STILL).update(STILL)]
    assert pickle.loads(pickle.dumps(both)) == both
    contact = pressed(None, shape)  # without a scale
    assert (contact.area_mm2, contact.centroid_mm, contact.spread_mm) == (None, None, None)


def fitted_surface(image: NDArray[np.uint8], degree: int) -> NDArray[np.uint8]:
    """A polynomial in x and y per channel, fitted by twelve rounds of robust least squares."""
    height, width = image.shape[:2]
    y, x = np.mgrid[-1 : 1 : height * 1j, -1 : 1 : width * 1j]
    powers = [x**i * y**j for i in range(degree + 1) for j in range(degree + 1 - i)]
    terms = np.stack(powers, -1).reshape(height * width, -1)
    surface = np.empty(image.shape)
    for channel in range(3):
        values, weight = image[..., channel].reshape(-1).astype(float), np.ones(height * width)
        for _ in range(12):
            root = np.sqrt(weight)
            fit = np.linalg.lstsq(terms * root[:, None], values * root, rcond=None)[0]
            rest = values - terms @ fit
            spread = 1.4826 * np.median(np.abs(rest))
            weight = 1 / (1 + (rest / (2 * spread)) ** 2) ** 2
        surface[..., channel] = (terms @ fit).reshape(height, width)
    return np.clip(np.rint(surface), 0, 255).astype(np.uint8)


@pytest.mark.slow
@pytest.mark.parametrize(("outline", "overlap"), [("dent", 0.58), ("contact", 0.53)])
def test_a_grasp_without_a_frame_at_rest(recordings, outline, overlap):
    folder = recordings / "digit" / "digit_grasp"
    raw, drawn = (imread(str(folder / name)) for name in ("raw.png", "mask_256x320.png"))
    drawn = cv2.resize(drawn.max(-1), raw.shape[1::-1], interpolation=cv2.INTER_NEAREST) > 127
    mask = contact_mask(raw, fitted_surface(raw, 4), reading="live", outline=outline)
    assert (mask & drawn).sum() / (mask | drawn).sum() == pytest.approx(overlap, abs=0.01)


def test_the_long_edge_of_a_calliper_is_outlined_and_the_faint_one_is_not(recordings):
    folder = recordings / "digit" / "digit_ball_D20641"
    pressed, baseline = (imread(str(folder / name)) for name in ("caliper.png", "background.png"))
    mask = contact_mask(pressed, baseline, reading="live")
    n, _, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    # One level for the whole picture, and the lower edge's change is a third of the upper one's.
    assert n == 2
    left, top, width, height, area = stats[1].tolist()
    assert (left, top, left + width) == (17, 0, 226)
    assert 100 < height < 130
    assert area == pytest.approx(20_050, rel=0.02)


@pytest.mark.parametrize("reading", ["paper", "live"])
def test_masks_and_maps_of_several_pictures(reading: Preset) -> None:
    frames = np.stack([[dented(20.0 * k, noise=k + 3 * f, seed=f) for k in range(3)] for f in range(2)])
    rests = np.stack([still(f) for f in range(2)])[:, None]
    for function, kind in ((contact_mask, "?"), (pressure_map, "f")):
        none = function(frames[:, :0], rests, reading)
        assert (none.shape, none.dtype.char) == ((2, 0, *frames.shape[2:4]), kind)
        with pytest.raises(InvalidValueError, match="masked"):
            function(np.ma.masked_greater(frames, 90), rests, reading)
        found = function(frames, rests, reading)
        assert found.shape[:2] == (2, 3)
        assert found[0, 2].any()
        for f, k in np.ndindex(2, 3):
            assert np.array_equal(found[f, k], function(frames[f, k], rests[f, 0], reading))
