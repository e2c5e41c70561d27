"""A live camera that is dark, torn or frozen has no vote; times are numbers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from reference.scripted import MS
from tega.config.choose import preset_metric
from tega.devices.base import TactileFrame
from tega.loop.inbox.frames import FrameMeter
from tega.loop.inbox.picture_votes import picture_fault, untouched_lines
from tega.loop.inbox.sources import SourceReport

Image = NDArray[np.uint8]
_RANDOM = np.random.default_rng(3)
_LIT = _RANDOM.integers(60, 140, (64, 48, 3)).astype(np.float64)
BASELINE: Image = _LIT.astype(np.uint8)


def picture(share: float = 1.0) -> Image:
    return np.clip(share * _LIT + _RANDOM.normal(0, 2, _LIT.shape), 0, 255).astype(np.uint8)


class Camera:
    def __init__(self, *, live: bool = True) -> None:
        self.report = SourceReport()
        self.meter = FrameMeter(BASELINE, preset_metric("live", BASELINE), self.report, live=live)
        self.n = 0

    def used(self, *images: Image) -> list[bool]:
        frames = [TactileFrame(k * 20 * MS, k, image, "") for k, image in enumerate(images, self.n)]
        self.n += len(images)
        return [self.meter.take(frame) is not None for frame in frames]


def test_a_dark_camera_has_no_vote_until_half_a_second_after_the_last_dark_picture() -> None:
    camera = Camera()
    assert camera.used(picture(), picture(0.5)) == [True, False]
    assert not camera.report.faults
    assert camera.used(picture()) == [True]  # one bad picture alone is left out
    assert camera.used(picture(0.5), picture(0.5)) == [False, False]
    (text,) = camera.report.faults
    assert text.startswith("dark: ")
    assert 47 <= float(text.removeprefix("dark: ").partition(" %")[0]) <= 53
    # 500 ms after the last dark one, which was 20 ms ago.
    assert camera.used(*(picture() for _ in range(26))) == [False] * 24 + [True, True]
    assert not camera.report.faults
    assert camera.report.n_unfit == 27


def test_a_torn_picture_is_left_out_and_a_camera_that_tears_them_has_no_vote() -> None:
    def torn(turns: int) -> Image:
        image = np.rot90(picture(), turns).copy()
        image[len(image) // 2 :] = 128
        return np.ascontiguousarray(np.rot90(image, -turns))

    for turns in range(4):
        camera = Camera()
        assert camera.used(picture(), torn(turns), picture()) == [True, False, True]
        old = picture()
        mixed = picture()
        mixed[-8:] = old[-8:]
        assert camera.used(old, mixed, picture()) == [True, False, True]
        assert camera.used(torn(turns), picture()) == [False, False]
        assert camera.report.faults == ("torn: part of each picture is missing, or of the one before",)


def test_a_frozen_camera_has_no_vote_until_a_picture_differs() -> None:
    camera, same = Camera(), picture()
    assert camera.used(same, same.copy(), same.copy(), same.copy()) == [True, True, False, False]
    assert camera.report.faults == ("frozen: it sends the same picture again and again",)
    assert camera.used(picture()) == [True]
    assert not camera.report.faults


def test_a_recording_keeps_its_dark_pictures() -> None:
    camera = Camera(live=False)
    assert camera.used(picture(), picture(0.2), picture(0.2), picture(0.2)) == [True] * 4


def test_an_edge_that_is_black_by_itself_is_not_torn() -> None:
    rim = BASELINE.copy()
    rim[:6] = rim[-6:] = 0
    untouched, before = untouched_lines(rim), list[bytes]()

    def seen(image: Image) -> Image:
        image[:6] = image[-6:] = 0
        return image

    for _ in range(5):
        fault, before = picture_fault(seen(picture()), untouched, before)
        assert not fault


@pytest.mark.parametrize("clip", ["digit_ball_D20641", "gsmini_shapes", "gsmini_soft_grips"])
def test_no_real_press_costs_a_vote(recordings: Path, clip: str) -> None:
    cv2: Any = pytest.importorskip("cv2")
    files = sorted(f for f in (recordings / "digit" / clip).rglob("*") if f.suffix in {".png", ".jpg"})[::3]
    assert len(files) > 7
    images = [image for image in (cv2.imread(str(file)) for file in files) if image is not None]
    untouched, before = untouched_lines(images[0]), list[bytes]()
    for image in (image for image in images[1:] if image.shape == images[0].shape):
        fault, before = picture_fault(image, untouched, before)
        assert not fault
