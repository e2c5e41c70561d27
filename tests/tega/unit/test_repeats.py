"""Pictures that are dark, torn or frozen have no vote; one that brings nothing new is neither measured nor new."""

from __future__ import annotations

import csv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace
from numpy.typing import NDArray

from reference.recordings import baseline, pressed, write_folder
from reference.scripted import MS, STARTED_NS, ScriptedCamera, Sink, live_frame, touching
from reference.wired import wired_loop
from tega.config import check_tree
from tega.config.choose import preset_metric
from tega.devices.base import TactileFrame
from tega.errors import RecordingError
from tega.loop import run_session
from tega.loop.inbox.frames import FrameMeter, measured_contacts
from tega.loop.inbox.picture_votes import (
    STUCK_FRAMES,
    is_repeat,
    kept_picture,
    picture_fault,
    untouched_lines,
)
from tega.loop.inbox.sources import SourceReport
from tega.loop.inbox.stream import PulledStream
from tega.loop.touch import STALE_NS
from tega.records import Contact
from tega.stages.metrics import LiveMetric


@pytest.fixture
def n_measured(monkeypatch: pytest.MonkeyPatch) -> Callable[[], int]:
    measured, update = list[int](), LiveMetric.update

    def counting(metric: LiveMetric, frame: Any, t_ns: int) -> Any:
        measured.append(t_ns)
        return update(metric, frame, t_ns)

    monkeypatch.setattr(LiveMetric, "update", counting)
    return lambda: len(measured)


def measure(script: list[Any], *, live: bool = True) -> tuple[list[Contact], SourceReport]:
    report = SourceReport()
    camera: Any = ScriptedCamera(script, live=live)
    meter = FrameMeter(baseline(), preset_metric("live", baseline()), report, live=live, start_ns=STARTED_NS)
    return list(measured_contacts(camera, meter)), report


def showing(*pictures: int) -> list[TactileFrame]:
    """Return frames with numbers of their own that show these pictures."""
    return [live_frame(k, image=pressed(60, noise=picture)) for k, picture in enumerate(pictures)]


def test_a_frame_delivered_again_is_neither_measured_nor_new(n_measured: Callable[[], int]) -> None:
    first, second = live_frame(0), live_frame(1)
    got, report = measure([first, first, first, None, first, second, second, live_frame(4)])
    assert [contact.t_ns // MS for contact in got] == [0, 16, 64]
    assert n_measured() == 3
    assert (report.n_items, report.n_duplicate, report.n_missing) == (3, 4, 2)
    assert (report.n_identical, report.n_stuck) == (0, 0)


def test_pictures_from_before_the_run_are_not_missing_in_it() -> None:
    """A camera counts on while it warms up and its baseline is taken; only what is lost afterwards counts."""
    got, report = measure([live_frame(30), live_frame(31), live_frame(34)])
    assert (len(got), report.n_missing) == (3, 2)
    _, recorded = measure([live_frame(2), live_frame(3)], live=False)
    assert recorded.n_missing == 2


def test_a_bad_frame_is_dropped_and_counted_and_not_tried_again() -> None:
    bad = live_frame(1, image=np.zeros((9, 9, 3), np.uint8))
    got, report = measure([live_frame(0), None, bad, bad, RecordingError("torn"), live_frame(4)])
    assert [contact.t_ns // MS for contact in got] == [0, 64]
    assert all(contact.in_contact for contact in got)
    assert (report.n_items, report.n_dropped, report.n_duplicate, report.n_missing) == (2, 2, 1, 3)
    assert report.lost == ""


def test_numbers_that_begin_again_are_new_frames() -> None:
    again = live_frame(9)._replace(seq=0)
    got, report = measure([live_frame(0), live_frame(1), again])
    assert len(got) == 3
    assert report.n_duplicate == 0


def test_equal_pixels_are_measured_once_and_give_the_same(n_measured: Callable[[], int]) -> None:
    got, report = measure(showing(0, 0, 1, 1, 2, 2))
    assert n_measured() == 3
    assert (report.n_items, report.n_identical, report.n_stuck) == (6, 3, 0)
    assert [contact.t_ns // MS for contact in got] == [0, 16, 32, 48, 64, 80]
    metric = preset_metric("live", baseline())
    three = [metric.update(pressed(60, noise=n), k * 16 * MS) for k, n in ((0, 0), (2, 1), (4, 2))]
    assert got == [replace(three[n], t_ns=k * 16 * MS) for k, n in enumerate((0, 0, 1, 1, 2, 2))]


def test_the_third_equal_picture_of_a_live_sensor_is_not_used(n_measured: Callable[[], int]) -> None:
    assert STUCK_FRAMES == 3
    got, report = measure(showing(0, 1, 1, 1, 1, 2, 2, 2, 3))
    assert [contact.t_ns // 16 // MS for contact in got] == [0, 1, 2, 5, 6, 8]
    assert n_measured() == 4
    assert (report.n_items, report.n_identical, report.n_stuck, report.n_missing) == (6, 5, 3, 0)
    assert n_measured() == report.n_items + report.n_stuck - report.n_identical


def test_a_buffer_that_is_filled_again_is_not_taken_for_a_stuck_sensor() -> None:
    buffer = np.empty_like(baseline())

    class Reusing(ScriptedCamera):
        def read(self, timeout_s: float) -> TactileFrame | None:
            frame = super().read(timeout_s)
            if frame is None:
                return None
            buffer[:] = frame.image
            return frame._replace(image=buffer)

    report = SourceReport()
    camera: Any = Reusing(showing(*range(6)))
    meter = FrameMeter(baseline(), preset_metric("live", baseline()), report, live=True)
    assert len(list(measured_contacts(camera, meter))) == 6
    assert report.n_identical == 0


def test_a_stuck_sensor_falls_silent_and_comes_back() -> None:
    contacts, report = measure(showing(0, 1, *[2] * 30, 3, 4, 5, 6))
    last_used_ns, back_ns = 3 * 16 * MS, 32 * 16 * MS
    assert [one for one in contacts if last_used_ns < one.t_ns < back_ns] == []
    vest = Sink()
    loop = wired_loop(contacts={"thumb": PulledStream(contacts)}, vests=[vest])
    loop.run()
    for t_ns, frame in vest.sent[:-1]:
        silent = last_used_ns + STALE_NS < t_ns < back_ns
        assert frame.intensities.any() != silent, t_ns
    assert loop.report.n_stale_ticks["thumb"] == 11
    assert report.n_stuck == 28


@given(data=st.data())
def test_pictures_are_equal_exactly_when_every_pixel_is(data: st.DataObject) -> None:
    height, width = data.draw(st.integers(1, 90)), data.draw(st.integers(1, 90))
    rng = np.random.default_rng(data.draw(st.integers(0, 99)))
    one = rng.integers(0, 256, (height, width, 3)).astype(np.uint8)
    other = one.copy()
    for _ in range(data.draw(st.integers(0, 2))):
        at = tuple(data.draw(st.integers(0, n - 1)) for n in (height, width, 3))
        other[at] = data.draw(st.integers(0, 255))
    if data.draw(st.booleans()):
        one, other = one[:, ::-1], other[:, ::-1]
    last = kept_picture(one, touching(7))
    equal = not np.count_nonzero(one.astype(int) - other.astype(int))
    assert is_repeat(other, last) == equal
    assert not is_repeat(one[:-1], last)


def test_a_recording_whose_pixels_stand_still_says_so(tmp_path: Path, n_measured: Callable[[], int]) -> None:
    folder = write_folder(tmp_path / "thumb", 12)
    for k in (4, 5, 6, 9):
        cv2.imwrite(str(folder / f"frame_{k}.png"), pressed(60, noise=k if k == 9 else 4))
    np.save(tmp_path / "gel.npy", baseline())
    thumb = {"driver": "images", "baseline": "gel.npy", "options": {"folder": "thumb"}}
    tree = {"session": {"pace": "fast", "out_dir": "out"}, "tactile": {"thumb": thumb}}
    summary = run_session(check_tree(tree, {}, base=tmp_path).config)
    thumb = summary["tactile"]["thumb"]
    assert (thumb["frames"], thumb["duplicate"], thumb["identical"], thumb["stuck"]) == (12, 0, 2, 0)
    assert n_measured() == 10
    assert any("2 frames have exactly the pixels of the one before" in note for note in summary["notes"])
    rows = list(csv.DictReader((tmp_path / "out" / "contacts.csv").read_text().splitlines()))
    assert len(rows) == 12
    assert rows[4]["eda"] == rows[5]["eda"] == rows[6]["eda"]


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
