"""Shear of the simulated gel, and what is read of it in pictures: bits, slip, memory of the way, reading, refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from tega.errors import InvalidValueError, ShapeError
from tega.setup.contract import check_stage
from tega.stages import FingerSetup
from tega.stages.events import Detector, ShearFrame, TouchFrame
from tega.stages.metrics import LiveOptions
from tega.stages.shear import ShearMetric
from tega.tactile.shear import ShearReader, ShearReading
from tega.tactile.tracker import TouchTracker
from tega_figures.shear import stuck_radius
from tega_sim.gel import PX_PER_MM, Gel, ball
from tega_sim.seams import Indenter, Shear

FRICTION, LOAD_N = 0.6, 4.0
# A bottle's wall before the gel, as it lies in a grip of the bench.
WALL_MM = np.array(
    [[0.0786, -0.0809, -0.9936, 22.34], [0.8155, -0.568, 0.1108, -5.39], [-0.5733, -0.8191, 0.0213, 39.9]]
)


def pulled(share: float, turn: tuple[float, float] = (0.0, 1.0), load_n: float = LOAD_N) -> Indenter:
    """Return a ball that is pulled sideways by a share of what friction bears."""
    x, y = (share * FRICTION * load_n * part for part in turn)
    return ball(force_n=load_n, radius_mm=12.0)._replace(shear_n=(x, y), friction=FRICTION)


def test_a_gel_without_shear_minds_no_pull_and_one_with_it_only_adds_its_grain() -> None:
    plain, other, grained = Gel(4), Gel(4), Gel(4, shear="texture")
    assert np.array_equal(plain.frame([pulled(0.0)], 70), other.frame([pulled(0.5)], 70))
    assert other.sheared.peak_mm == 0.0
    assert not other.shear_mm().any()
    off = grained.frame([pulled(0.0)], 70).astype(int) - plain.frame([pulled(0.0)], 70)
    # The grain and its rounding: a count or two, no more of it in one direction than in the other.
    assert 0 < np.abs(off).max() <= 3
    assert abs(off.mean()) < 0.02
    assert grained.truth == plain.truth


def test_the_same_pulls_give_the_same_bits_and_forgetting_begins_anew() -> None:
    def course(gel: Gel) -> np.ndarray[Any, Any]:
        for number, share in enumerate((0.2, 0.6, 0.4)):
            image = gel.frame([pulled(share)], number)
        return image

    one, two = Gel(4, shear="dots"), Gel(4, shear="dots")
    first = course(one)
    assert np.array_equal(first, course(two))
    one.forget()
    assert one.sheared.peak_mm == 0.0
    assert np.array_equal(first, course(one))
    assert not np.array_equal(first, two.frame([pulled(0.0)], 2))


def test_a_pull_moves_the_gel_its_way_and_slips_at_the_rim_first() -> None:
    gel, slid = Gel(2, shear="texture"), []
    for step in range(1, 46):
        gel.press([pulled(step / 50, (0.6, -0.8))])
        slid.append(gel.sheared.slid)
    x_mm, y_mm = gel.sheared.mean_mm
    assert x_mm > 0.1
    assert y_mm / x_mm == pytest.approx(-0.8 / 0.6, rel=0.05)
    assert slid[0] < 0.1
    assert slid[-1] > 0.6
    assert np.all(np.diff(slid) > -0.05)
    field = np.linalg.norm(gel.shear_mm(), axis=2)
    # The middle of the contact sticks and goes farthest; its rim lags behind.
    assert field[20, 15] == pytest.approx(gel.sheared.peak_mm, rel=0.02)
    assert field[20, 22] < 0.7 * field[20, 15]


def test_what_has_slid_does_not_come_back_with_the_pull_and_all_is_gone_when_it_is_let_go() -> None:
    gel = Gel(2, shear="texture")
    for share in [*np.linspace(0.02, 0.9, 45), *np.linspace(0.88, 0.0, 45)]:
        gel.press([pulled(float(share))])
    left_mm = float(np.abs(gel.shear_mm()).max())
    assert left_mm > 0.05
    gel.press([])
    assert gel.sheared == ((0.0, 0.0), 0.0, 0.0)
    # Nothing has slid under a small pull, so that it comes back.
    for share in [*np.linspace(0.0, 0.03, 20), *np.linspace(0.03, 0.0, 20)]:
        gel.press([pulled(float(share))])
    assert gel.sheared.peak_mm < 0.1 * left_mm


def test_a_gel_that_has_slid_rests_under_a_pull_that_does_not_change() -> None:
    """A broad wall that slid, was let go by half and pulled another way: the way once went to and fro for ever."""
    gel, peaks_mm = Gel(2, shear="texture"), []
    for step in range(160):
        share, turn = (step / 30, (1.0, 0.0)) if step < 30 else (0.55, (0.6, -0.8))
        load_n = 4.0 if step < 60 else 5.0
        wall = pulled(min(share, 0.999), turn, load_n)
        gel.press([wall._replace(shape="capsule", size_mm=(41.0, 89.0, 0.0), pose_mm=WALL_MM)])
        peaks_mm.append(gel.sheared.peak_mm)
    assert peaks_mm[-1] > 0.1
    assert np.abs(np.diff(peaks_mm[80:])).max() < 0.005


@pytest.mark.parametrize("load_n", [2.0, 4.0])
@pytest.mark.parametrize("share", [0.2, 0.4, 0.6, 0.8])
def test_a_ball_sticks_where_cattaneo_and_mindlin_have_it(load_n: float, share: float) -> None:
    found, less = stuck_radius(load_n, share)
    assert found == pytest.approx((1 - share) ** (1 / 3), rel=0.05)
    # Ciavarella and Jäger: what sticks is what would touch under that much less force.
    assert found == pytest.approx(less, rel=0.06)


@pytest.mark.parametrize(
    ("wrong", "named"),
    [
        ({"shear_n": (float("nan"), 0.0)}, "shear_n"),
        ({"shear_n": (0.0, 2000.0)}, "shear_n"),
        ({"friction": -0.1}, "friction"),
    ],
)
def test_a_pull_that_is_none_is_refused(wrong: dict[str, Any], named: str) -> None:
    with pytest.raises(InvalidValueError, match=named):
        Gel(1, shear="dots").press([pulled(0.1)._replace(**wrong)])
    with pytest.raises(InvalidValueError, match="shear"):
        Gel(1, shear="velvet")  # type: ignore[arg-type]


def follow(kind: Shear, seed: int, top: float) -> tuple[list[ShearReading], list[float]]:
    """Press a ball, pull it to a share of the limit, hold it: what is read, and the true displacement of its middle."""
    gel = Gel(seed, memory=True, shear=kind)
    baseline = np.rint(np.mean([gel.frame([], n) for n in range(30)], axis=0)).astype(np.uint8)
    tracker, reader = TouchTracker(baseline), ShearReader(baseline, mm_per_px=1 / PX_PER_MM)
    read, true_mm = [], []
    for n in range(100):
        share = top * min(max(n - 20, 0) / 60, 1.0)
        image = gel.frame([pulled(share, load_n=min(LOAD_N, 0.25 * (n + 1)))], 30 + n)
        tracker.update(image)
        read.append(reader.update(image, tracker))
        true_mm.append(gel.sheared.peak_mm)
    return read, true_mm


@pytest.mark.parametrize("kind", ["texture", "dots"])
@pytest.mark.parametrize("seed", [3, 4])
def test_the_pull_of_a_simulated_gel_is_read_from_its_grain(kind: Shear, seed: int) -> None:
    read, true_mm = follow(kind, seed, 0.9)
    late = read[-1]
    assert true_mm[-1] > 0.7
    # Near the slip of all of it the middle is read too far out: by a fifth where only some dots are in the contact.
    assert late.shear_mm == pytest.approx(true_mm[-1], rel=0.25)
    assert late.direction_rad == pytest.approx(np.pi / 2, abs=0.15)
    half = read[50]
    assert half.shear_mm == pytest.approx(true_mm[50], abs=0.08)
    assert half.incipient < late.incipient
    assert late.incipient > 0.35


@pytest.mark.parametrize("kind", ["texture", "dots"])
def test_a_press_without_a_pull_is_read_as_none(kind: Shear) -> None:
    read, _ = follow(kind, 3, 0.0)
    assert max(one.shear_mm for one in read[20:]) < 0.06
    assert max(one.incipient for one in read[20:]) == 0.0


def test_a_print_that_is_moved_under_a_press_is_found_again() -> None:
    """Independent of the simulated shear: blots of ink on a plain gel, moved by so many pixels."""
    rng = np.random.default_rng(0)
    places = rng.uniform((4, 4), (236, 316), (600, 2))
    gel, press = Gel(3), [ball(force_n=4.0, radius_mm=12.0)]
    gel.press(press)
    depth_mm = gel.displacement_mm()

    def picture(number: int, dx: float, dy: float, *, pressed: bool) -> np.ndarray[Any, Any]:
        level = gel.frame(press if pressed else [], number).astype(float)
        for was_x, was_y in places:
            share = min(1.0, 2 * depth_mm[int(was_y) // 4, int(was_x) // 4] / depth_mm.max())
            x, y = was_x + share * dx, was_y + share * dy
            top, left = max(int(y) - 4, 0), max(int(x) - 4, 0)
            patch = level[top : top + 10, left : left + 10]
            r, c = np.ogrid[top : top + patch.shape[0], left : left + patch.shape[1]]
            patch -= 20 * np.exp(-((c - x) ** 2 + (r - y) ** 2) / 4.0)[:, :, None]
        image: np.ndarray[Any, Any] = np.clip(np.rint(level), 0, 255).astype(np.uint8)
        return image

    untouched = [picture(n, 0, 0, pressed=False) for n in range(8)]
    baseline = np.rint(np.mean(untouched, axis=0)).astype(np.uint8)
    tracker, reader = TouchTracker(baseline), ShearReader(baseline, mm_per_px=0.05)
    course = [(0, 0)] * 3 + [(0.6, 0.8), (1.2, 1.6), (1.8, 2.4), (2.4, 3.2)] + [(3, 4)] * 3
    for number, (dx, dy) in enumerate(course):
        image = picture(8 + number, dx, dy, pressed=True)
        assert tracker.update(image).in_contact
        told = reader.update(image, tracker)
    assert told.shear_mm == pytest.approx(0.05 * 5.0, rel=0.08)
    assert told.direction_rad == pytest.approx(np.arctan2(4, 3), abs=0.05)
    assert told.sure > 0.8
    flow = reader.flow()
    assert flow.shape == (40, 30, 2)
    assert flow[20, 15] == pytest.approx((3.0, 4.0), abs=0.2)
    assert not flow[0, 0].any()


def test_the_reader_refuses_what_is_no_frame_of_its_sensor() -> None:
    gel = np.full((320, 240, 3), 90, np.uint8)
    tracker, reader = TouchTracker(gel), ShearReader(gel)
    with pytest.raises(ShapeError):
        reader.update(gel[:100], tracker)
    with pytest.raises(InvalidValueError, match="dt_s"):
        reader.update(gel, tracker, dt_s=-1.0)
    with pytest.raises(InvalidValueError, match="mm_per_px"):
        ShearReader(gel, mm_per_px=5.0)


def test_the_metric_tells_what_live_tells_and_the_shear() -> None:
    check_stage(ShearMetric)
    gel = Gel(3, shear="dots")
    baseline = gel.still()
    metric = ShearMetric(FingerSetup("index", baseline), LiveOptions())
    for n in range(40):
        contact = metric.update(gel.frame([pulled(n / 50)], n), round(n / 60 * 1e9))
    told = {value.name: value for value in contact.more}
    assert told.keys() == ShearMetric.units(LiveOptions()).keys()
    assert told["shear_mm"].value == pytest.approx(gel.sheared.peak_mm, rel=0.2)
    assert told["shear_mm"].unit == "mm"
    empty = metric.update(gel.frame([], 41), round(41 / 60 * 1e9) + 10**9)
    assert not empty.in_contact
    assert [value.value for value in empty.more] == [0.0] * 5


def test_the_detector_uses_the_shear_where_it_is_told_any() -> None:
    touch = TouchFrame(in_contact=True, eda=4000, mass=4e4, peak=30.0, x=120.0, y=160.0)
    without, with_shear = Detector(), Detector()
    for n in range(60):
        without.touch(n / 60, "thumb", touch)
        with_shear.shear(n / 60, "thumb", ShearFrame(0.0, 0.02 * max(n - 50, 0), 0.5, 1.0))
        with_shear.touch(n / 60, "thumb", touch)
    before, seen = without.features(1.0), with_shear.features(1.0)
    assert seen[: len(before)] == before
    pulled_by = seen[len(before)]
    assert pulled_by > np.log1p(20 * 0.05)


def test_a_recording_that_does_not_say_how_sure_its_shear_is_has_its_slips_told_by_touch() -> None:
    values = {"shear_mm": 1.0, "shear_direction_rad": 0.0, "incipient": 0.5, "slip_mm_s": 2.0}
    assert ShearFrame.of(values) is None
    assert ShearFrame.of(values | {"shear_sure": 0.2}) == (1.0, 0.0, 0.5, 2.0, 0.2)
