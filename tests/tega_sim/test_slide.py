"""Relief of objects on a simulated gel, and the slide that is read of it: bits, contrast, known speeds."""

from __future__ import annotations

import numpy as np
import pytest

from tega.errors import InvalidValueError
from tega.stages.events import ShearFrame
from tega_figures.slide import SlideStep, fine, slid, speeding, wall
from tega_sim.gel import Gel
from tega_sim.world import OBJECTS

COUNTS = 1.5  # some half of the contrast of a recorded printed disc
AFTER_RISE = 30 + 6  # frames until a course of `speeding` slides evenly
PRESSED = SlideStep(3.0, 0.0, 0.0)


def test_a_plain_gel_and_a_smooth_object_show_no_relief() -> None:
    plain, grained = Gel(4), Gel(4, shear="texture")
    assert np.array_equal(plain.frame([wall(PRESSED, 0.0)], 70), plain.frame([wall(PRESSED, 5.0)], 70))
    smooth = grained.frame([wall(PRESSED, 0.0)], 70)
    assert not np.array_equal(smooth, grained.frame([wall(PRESSED, 5.0)], 70))
    assert np.array_equal(smooth, grained.frame([wall(PRESSED, 0.0)], 70))


def test_an_imprint_lies_inside_the_contact_and_grows_with_the_pressure() -> None:
    gel, found = Gel(4, shear="texture"), []
    for load_n in (1.0, 3.0):
        step = SlideStep(load_n, 0.0, 0.0)
        smooth = fine(gel.frame([wall(step, 0.0)], 70))
        off = fine(gel.frame([wall(step, 4.0)], 70)) - smooth
        inside = gel.contact_mask()[::2, ::2]
        beyond = np.zeros_like(inside)
        beyond[:, :20] = True  # more than 12 points from the contact
        assert np.abs(off[beyond]).max() == 0.0
        found.append(off[inside].std())
    # As the root of the pressure, which grows more slowly than the load.
    assert 1.1 < found[1] / found[0] < 3**0.5


def test_an_imprint_goes_with_the_object_that_slides_and_with_the_gel_that_is_pulled() -> None:
    def shown(step: SlideStep) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
        gel = Gel(4, shear="texture", spread=0.0, shape="flat")
        smooth = gel.frame([wall(step, 0.0)], 70)
        gel.forget()
        return fine(gel.frame([wall(step, 8.0)], 70)) - fine(smooth)

    rested, inner = shown(PRESSED), (slice(60, 100), slice(50, 70))
    for step, way_mm in ((PRESSED._replace(way_mm=0.535), 0.535), (PRESSED._replace(share=0.5), 0.2)):
        moved = shown(step)
        fits = [float((rested[inner] * np.roll(moved, -n, axis=0)[inner]).sum()) for n in range(12)]
        points = round(way_mm * 18.68 / 2)
        assert points - 1 <= int(np.argmax(fits)) <= points + 1


@pytest.mark.parametrize("mm_s", [6.0, 12.0])
@pytest.mark.parametrize(("y_mm", "bound_mm_s"), [(None, 2.0), (-9.0, 2.5)])
def test_a_known_slide_is_read_within_40_ms(mm_s: float, y_mm: float | None, bound_mm_s: float) -> None:
    # Across the picture's upper border less than half of the contact is seen.
    off, told = [], []
    for seed in (30, 31):
        course = slid(seed, speeding(3.0, mm_s), COUNTS, y_mm=y_mm)
        # Two frames at 60 Hz after the speed has stopped to change.
        late = slice(AFTER_RISE + 2, None)
        told.append(course.sure[late] > 0)
        off.append(np.abs(course.speed_mm_s[late] - mm_s)[told[-1]])
    assert np.mean(told) > 0.9
    assert np.quantile(np.concatenate(off), 0.9) <= bound_mm_s


def test_nothing_slides_where_the_gel_goes_along_or_the_press_changes() -> None:
    pulled = [
        SlideStep(3.0 * min((n + 1) / 12, 1.0), 0.0, 0.5 * min(max(n - 30, 0) / 45, 1.0)) for n in range(80)
    ]
    grows = [SlideStep(0.5 + 5.0 * n / 80, 0.0, 0.0) for n in range(80)]
    let_go = [SlideStep(4.0 * max(np.sin(np.pi * n / 60), 0.0), 0.0, 0.0) for n in range(70)]
    for steps in (pulled, grows, let_go):
        course = slid(30, steps, COUNTS)
        told = course.sure > 0
        assert np.all(course.speed_mm_s[told] <= 3.0)
        assert np.quantile(course.speed_mm_s[told], 0.9) <= 2.0


def test_no_speed_is_told_of_a_smooth_object() -> None:
    for seed in (30, 31, 32):
        course = slid(seed, speeding(3.0, 12.0), 0.0)
        assert not course.sure.any()
        assert not course.speed_mm_s.any()


@pytest.mark.parametrize(
    ("counts", "length_mm"), [(-1.0, 0.6), (21.0, 0.6), (1.0, 0.05), (1.0, float("nan"))]
)
def test_a_relief_that_is_none_is_refused(counts: float, length_mm: float) -> None:
    one = wall(PRESSED, 0.0)._replace(relief_counts=counts, relief_mm=length_mm)
    with pytest.raises(InvalidValueError, match="relief"):
        Gel(1, shear="texture").frame([one], 0)


def test_an_object_may_have_a_relief_and_has_none_unless_it_is_given() -> None:
    assert all(one.relief_counts == 0.0 for one in OBJECTS.values())
    assert OBJECTS["bottle"].with_(relief_counts=1.5).relief_counts == 1.5
    with pytest.raises(InvalidValueError, match="relief_counts"):
        OBJECTS["bottle"].with_(relief_counts=-1.0)


def test_what_a_contact_says_of_the_slide_goes_to_the_detector_with_its_direction() -> None:
    values = {
        "shear_mm": 0.0,
        "shear_direction_rad": 0.0,
        "incipient": 0.0,
        "slip_mm_s": 0.0,
        "shear_sure": 0.2,
    }
    told = ShearFrame.of(values | {"slide_mm_s": 5.0, "slide_direction_rad": np.pi / 2, "slide_sure": 0.7})
    assert told is not None
    assert told[-3:] == pytest.approx((0.0, 5.0, 0.7))
