"""The live metric: rest taken anew, millimetres, and recordings of other sensors."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from tega.config.choose import preset_metric
from tega.emg import Preset
from tega.loop.adapting import REZERO_SEAT, FingerRezero, RezeroKey
from tega.loop.inbox.sources import SourceReport
from tega.records import Button, Contact
from tega.records.bus import Bus
from tega.stages.base import Metric
from tega.tactile import contact_mask
from tega.tactile.tracker import GelLight, TouchTracker, TrackedContact, nominal_light

STILL = np.full((320, 240, 3), 120, np.uint8)


def marked() -> np.ndarray:
    """A gel with a dent that does not go: what a cut or a new camera position leaves."""
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
    tracker = TouchTracker(gel, light=light)
    frame = gel.copy()
    frame[100:160, 80:140] += 40
    tracker.update(frame)
    return tracker.update(frame)


@pytest.mark.parametrize("shape", [(320, 240), (240, 320), (480, 640)])
def test_middle_spread_and_area_are_scaled_alike(shape: tuple[int, int]) -> None:
    light = nominal_light()._replace(mm_per_px=0.06)
    contact = pressed(light, shape)
    # The scale is that of a picture of 320 x 240.
    mm = 0.06 * 400 / np.hypot(*shape)
    assert contact.in_contact
    assert contact.area_mm2 == pytest.approx(contact.eda * mm**2)
    assert contact.spread_mm == pytest.approx(contact.spread * mm)
    assert contact.centroid_mm == pytest.approx([(at + 0.5) * mm for at in contact.centroid_xy])


def test_without_a_scale_there_are_no_millimetres() -> None:
    contact = pressed(None, (320, 240))
    assert contact.in_contact
    assert (contact.area_mm2, contact.centroid_mm, contact.spread_mm) == (None, None, None)


def picture(path: Path) -> NDArray[np.uint8]:
    image = cv2.imread(str(path))
    assert image is not None, path
    return np.asarray(image, np.uint8)


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
    fitted: NDArray[np.uint8] = np.clip(np.rint(surface), 0, 255).astype(np.uint8)
    return fitted


@pytest.mark.slow
@pytest.mark.parametrize(("outline", "overlap"), [("dent", 0.58), ("contact", 0.53)])
def test_a_grasp_without_a_frame_at_rest(recordings, outline, overlap):
    folder = recordings / "digit" / "digit_grasp"
    raw, drawn = picture(folder / "raw.png"), picture(folder / "mask_256x320.png")
    drawn = cv2.resize(drawn.max(-1), raw.shape[1::-1], interpolation=cv2.INTER_NEAREST) > 127
    mask = contact_mask(raw, fitted_surface(raw, 4), reading="live", outline=outline)
    assert (mask & drawn).sum() / (mask | drawn).sum() == pytest.approx(overlap, abs=0.01)


def test_the_long_edge_of_a_calliper_is_outlined_and_the_faint_one_is_not(recordings):
    folder = recordings / "digit" / "digit_ball_D20641"
    pressed, baseline = (picture(folder / name) for name in ("caliper.png", "background.png"))
    mask = contact_mask(pressed, baseline, reading="live")
    n, _, stats, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8))
    # One level for the whole picture, and the lower edge's change is a third of the upper one's.
    assert n == 2
    left, top, width, height, area = stats[1].tolist()
    assert (left, top, left + width) == (17, 0, 226)
    assert 100 < height < 130
    assert area == pytest.approx(20_050, rel=0.02)
