"""The ``live`` reading on real recordings: marked presses, two at once, other sensors, grips, and nothing at rest."""

from __future__ import annotations

from itertools import combinations
from math import dist
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from tega.runtime.opencv import read_image
from tega.tactile import contact_mask, estimate_baseline, read_contact
from tega_figures.audit import Mark, read_marks

pytest.importorskip("cv2", reason="needs the extra tega[lab]")
pytest.importorskip("scipy", reason="needs the extra tega[lab]")
pytest.importorskip("mujoco", reason="needs the extra tega[sim]")

import cv2

from tega_figures.touch_demo import score_demo
from tega_figures.touch_jitter import Case, measure

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


def test_marked_ball_presses_are_outlined(presses: Presses) -> None:
    circles = [presses.distance(i) <= 1 for i in range(30)]
    masks = [contact_mask(frame, presses.baseline, reading="live") for frame in presses.frames]
    assert all(mask.any() for mask in masks)
    overlaps = [overlap(*both) for both in zip(masks, circles, strict=True)]
    assert np.median(overlaps) >= 0.80
    assert np.quantile(overlaps, 0.1) >= 0.69
    areas = [mask.sum() / circle.sum() for mask, circle in zip(masks, circles, strict=True)]
    assert 0.92 <= np.median(areas) <= 1.08


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
    eda, cci = np.array([(m.eda, m.cci) for m in metrics]).T
    assert not eda[first : last + 1].any()
    # The first frames show the session before. The rest is judged by how much the picture differs.
    start = 0 if name.startswith("avocado") else 12
    differs = np.abs(frames.astype(np.int16) - baseline).mean(axis=(1, 2, 3))[start:]
    eda, cci = eda[start:], cci[start:]
    held, idle = differs > 0.5 * differs.max(), differs < 0.15 * differs.max()
    # A grip may be felt in the frame before the picture differs by that much, and in the one after.
    beside = np.convolve(~idle, [1, 1, 1], "same") > 0
    for measured in (eda, cci):
        assert measured[held].min() > 0.3 * measured.max()
        assert not measured[idle & ~beside].any()
    assert np.count_nonzero(eda[idle & beside]) <= 2


# Wide dents pull the gain of most lines; the edge lies on a picture whose medians move with the bands.
HOLDS = (
    Case("face", 0.3, "lamps", "D20641", 5135174947018068958),
    Case("large ball", 0.3, "slopes", "vocdex", 6492855054770293862),
    Case("edge", 0.8, "slopes", "tacto", 6191578288683992749),
)
# Fitted line by line, slow bands put these areas off by 8 to 23 %. The last was off by 50 % when it was outlined by a
# depth that its light contradicts.
SLOW = tuple(
    case._replace(lamp_hz=120.0)
    for case in (
        Case("bar", 0.2, "slopes", "D20641", 14220176138537047688),
        Case("bar", 0.3, "slopes", "D20641", 7570470667680161510),
        Case("face", 0.3, "slopes", "D20641", 13908686207634548141),
        Case("edge", 0.4, "lamps", "D20641", 282747977437598182),
        Case("edge", 0.8, "slopes", "tacto", 6191578288683992749),
    )
)


# The edge under either lamp and a bar at every turn; the others, a second each, by make slow.
OFTEN = (HOLDS[-1], SLOW[0], SLOW[-1])
EACH = [
    pytest.param(
        hold, marks=[] if hold in OFTEN else pytest.mark.slow, id=f"{hold.shape}, {hold.lamp_hz:g} Hz"
    )
    for hold in HOLDS + SLOW
]


@pytest.mark.parametrize("hold", EACH)
def test_bands_of_mains_light_leave_the_area_of_a_hold(
    recordings: Path, monkeypatch: pytest.MonkeyPatch, hold: Case
) -> None:
    monkeypatch.setenv("TEGA_DATA", str(recordings))
    still = measure(hold)
    banded = measure(hold._replace(mains=0.02))
    assert banded.reported == 1.0
    assert banded.area_px == pytest.approx(still.area_px, rel=0.05)
    assert banded.area_scatter < 0.04


@pytest.mark.slow
def test_every_finger_of_the_demo_is_felt_while_it_carries_and_its_area_does_not_jump() -> None:
    """A frame is left out of what has to be felt where no part of what touches is in the picture."""
    scores = score_demo().values()
    for score in scores:
        assert score.in_view > 1000
        assert score.missed_in_view + score.missed_partly <= 0.02 * (score.in_view + score.partly)
        assert score.beyond + score.partly + score.in_view == score.loaded
        assert (score.told_late, score.full) == (0, 0)
    assert sum(score.jumps for score in scores) <= 0.002 * sum(score.steady for score in scores)
    assert np.median([score.rank for score in scores]) >= 0.9
