"""The ``live`` reading on real recordings: marked presses, two at once, other sensors, grips, and nothing at rest."""

from __future__ import annotations

from itertools import combinations
from math import dist
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tega.runtime.opencv import read_image
from tega.tactile import contact_mask, estimate_baseline, read_contact
from tega_figures.audit import Mark, read_marks

Image = NDArray[np.uint8]
# Frames of the no-contact gel in each grip, counted from 0.
AT_REST = {
    "wooden_statue_1_camera_0": (9, 19),
    "wooden_statue_1_camera_2": (9, 19),
    "ball_white_thread_7_camera_2": (6, 11),
    "avocado_real_5_camera_0": (390, 439),
}


class Presses:
    """Ball presses with hand-marked circles."""

    def __init__(self, folder: Path) -> None:
        self.baseline: Image = read_image(folder / "background.png", driver="test")
        marks = read_marks(folder / "annotate.csv")
        self.marks: list[Mark] = list(marks.values())
        self.frames: list[Image] = [read_image(folder / name, driver="test") for name in marks]

    def distance(self, index: int) -> NDArray[np.float64]:
        """Distance of every pixel from a mark's centre, in radii of the mark."""
        return self.marks[index].distance(self.baseline.shape)


@pytest.fixture(scope="module")
def presses(recordings: Path) -> Presses:
    return Presses(recordings / "digit" / "digit_ball_D20641")


def overlap(a: NDArray[np.bool_], b: NDArray[np.bool_]) -> float:
    return float((a & b).sum() / (a | b).sum())


def test_two_presses_at_once_are_both_outlined(presses: Presses) -> None:
    overlaps = []
    centres = [mark.centre_xy for mark in presses.marks]
    apart = [(i, j) for i, j in combinations(range(30), 2) if dist(centres[i], centres[j]) > 120]
    for i, j in apart[::5]:
        left, right = presses.distance(i), presses.distance(j)
        nearer = left * presses.marks[i].radius_px < right * presses.marks[j].radius_px
        frame = np.where(nearer[..., np.newaxis], presses.frames[i], presses.frames[j])
        mask = contact_mask(frame, presses.baseline, reading="live")
        overlaps.append(overlap(mask, (left <= 1) | (right <= 1)))
    assert len(overlaps) > 30
    # One level for both: beside a stronger press the weaker one is outlined to a third of its area.
    assert np.median(overlaps) > 0.75
    assert np.quantile(overlaps, 0.1) > 0.6


def test_what_lies_far_from_a_press_is_no_contact(presses: Presses) -> None:
    found = []
    for i, press in enumerate(presses.frames):
        # The gel is drawn down around a ball: out to some three radii that is seen, and is no false contact.
        far = presses.distance(i) > 3
        frame = np.where(far[..., np.newaxis], press, presses.baseline)
        metrics = read_contact(frame, presses.baseline, reading="live")
        assert metrics.in_contact == (metrics.eda > 0) == (metrics.cci > 0)
        found.append(metrics.in_contact)
    # One of the thirty is drawn down further.
    assert sum(found) <= 1


def test_presses_are_enough_to_find_their_own_baseline(presses: Presses) -> None:
    estimated = estimate_baseline(presses.frames)
    overlaps = [
        overlap(contact_mask(frame, estimated, reading="live"), presses.distance(i) <= 1)
        for i, frame in enumerate(presses.frames)
    ]
    assert np.median(overlaps) >= 0.78


def test_another_sensor_is_read_with_the_same_constants(recordings: Path) -> None:
    folder = recordings / "digit" / "digit_ball_vocdex_a"
    frames = [read_image(path, driver="test") for path in sorted(folder.glob("*.png"))]
    baseline = estimate_baseline(frames)
    radii = [np.sqrt(read_contact(frame, baseline, reading="live").eda / np.pi) for frame in frames]
    assert len(radii) == 14
    assert min(radii) > 0
    # One ball, pressed alike: one size.
    assert np.std(radii) < 0.1 * np.mean(radii)


def video(path: Path) -> NDArray[np.uint8]:
    cv2: Any = pytest.importorskip("cv2", reason="needs the extra tega[lab]")
    capture = cv2.VideoCapture(str(path))
    frames = []
    while (read := capture.read())[0]:
        frames.append(read[1])
    return np.array(frames, np.uint8)


@pytest.mark.parametrize("name", list(AT_REST))
def test_grips_on_a_dotted_gel_rise_and_fall(recordings: Path, name: str) -> None:
    frames = video(recordings / "digit" / "gsmini_seq" / f"{name}.avi")
    first, last = AT_REST[name]
    rest = np.median(frames[first : last + 1], axis=0).astype(np.uint8)
    baseline = estimate_baseline(list(frames))
    assert np.abs(baseline.astype(int) - rest).mean() < 1.5
    metrics = [read_contact(frame, baseline, reading="live") for frame in frames]
    eda = np.array([m.eda for m in metrics])
    cci = np.array([m.cci for m in metrics])
    assert not eda[first : last + 1].any()
    # The first frames show the session before. The rest is judged by how much the picture differs.
    start = 0 if name.startswith("avocado") else 12
    differs = np.abs(frames.astype(np.int16) - baseline).mean(axis=(1, 2, 3))[start:]
    eda, cci = eda[start:], cci[start:]
    held, idle = differs > 0.5 * differs.max(), differs < 0.15 * differs.max()
    assert eda[held].min() > 0.3 * eda.max()
    assert cci[held].min() > 0.3 * cci.max()
    # A grip may be felt in the frame before the picture differs by that much, and in the one after.
    beside = np.convolve(~idle, [1, 1, 1], "same") > 0
    assert not eda[idle & ~beside].any()
    assert not cci[idle & ~beside].any()
    assert np.count_nonzero(eda[idle & beside]) <= 2
