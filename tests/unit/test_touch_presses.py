"""The touch tracker on simulated presses of every shape, with leftovers and drift: felt early, steadily, and not
when it is over."""

from __future__ import annotations

import numpy as np
import pytest

from tega.errors import InvalidValueError
from tega.sim.gel import Gel
from tega.sim.gel_sequences import SHAPES, Moment, press_sequence, ramp
from tega.touch import GelLight, KnownPress, TouchTracker, TrackedContact, calibrate_light, nominal_light
from tega_figures.check_touch_live import felt_of_slow_press
from tega_figures.touch_presses import score_press, unit_seeds

pytest.importorskip("scipy", reason="needs the extra tega[lab]")
UNITS = unit_seeds(2)


@pytest.mark.parametrize("name", SHAPES)
def test_a_press_is_felt_early_smoothly_and_no_longer_than_it_lasts(name: str) -> None:
    for seed in UNITS:
        score = score_press(name, seed)["live"]
        assert score.felt_n <= 0.5
        assert score.peak_rank >= 0.98
        # A face's touching area hardly changes.
        assert np.isnan(score.area_rank) or score.area_rank >= 0.95
        assert score.steady <= 0.03
        assert score.held_jump <= 0.15
        assert score.rising_jump <= 0.10
        assert score.released_s <= 0.1 + 1e-9
        assert (score.false_before, score.false_after) == (0, 0)


@pytest.mark.parametrize("name", SHAPES)
def test_a_press_over_three_seconds_is_felt_by_six_tenths_of_a_newton(name: str) -> None:
    assert felt_of_slow_press(name, UNITS[0], 3.0) <= 0.6


@pytest.mark.parametrize("name", SHAPES)
def test_an_eased_grip_stays_felt_for_ten_seconds(name: str) -> None:
    ends_s, forces_n = (2.0, 3.0, 4.0, 7.0, 17.0), (0.0, 5.0, 5.0, 0.5, 0.5)
    moments = press_sequence(
        name,
        seed=UNITS[0],
        force_n=lambda t_s: float(np.interp(t_s, ends_s, forces_n)),
        duration_s=17.0,
        rate_hz=15.0,
    )
    first = next(moments)
    tracker = TouchTracker(first.image, rate_hz=15.0)
    on = [(m.t_s, tracker.update(m.image).in_contact) for m in moments]
    assert all(felt for t_s, felt in on if t_s > 3.0)


def untouched(seed: int, minutes: float, rate_hz: float) -> int:
    gel = Gel(seed, memory=True)
    tracker = TouchTracker(gel.frame([], 0), rate_hz=rate_hz)
    step = round(60 / rate_hz)
    return sum(tracker.update(gel.frame([], k)).in_contact for k in range(step, round(minutes * 3600), step))


def test_a_minute_untouched_is_no_contact() -> None:
    assert untouched(UNITS[0], 1.0, 30.0) == 0


@pytest.mark.deep
@pytest.mark.parametrize("seed", unit_seeds(4))
def test_an_hour_untouched_is_no_contact(seed: int) -> None:
    assert untouched(seed, 60.0, 60.0) == 0


def held(
    name: str, seed: int, force_n: float, light: GelLight | None = None
) -> tuple[TrackedContact, Moment]:
    """Press and hold; return the last reading and what is true then."""
    curve = ramp(peak_n=force_n, wait_s=1.0, rise_s=1.0, hold_s=1.0, fall_s=0.1)
    moments = list(press_sequence(name, seed=seed, force_n=curve, duration_s=2.5, rate_hz=30.0))
    tracker = TouchTracker(moments[0].image, rate_hz=30.0, light=light)
    return [tracker.update(m.image) for m in moments][-1], moments[-1]


def test_the_light_that_calibration_begins_with_is_the_tracker_s_own() -> None:
    by_name, by_default = held("bar", 1, 3.0, nominal_light())[0], held("bar", 1, 3.0)[0]
    assert (by_name.depth_mm, by_name.force_n) == (by_default.depth_mm, by_default.force_n)


def test_calibrated_presses_read_true_on_average() -> None:
    known = []
    for name, force_n in (("ball 4 mm", 1.5), ("ball 4 mm", 4.0), ("face", 4.0)):
        contact, moment = held(name, UNITS[0], force_n)
        known.append(KnownPress(contact, force_n, moment.depth_mm))
    light = calibrate_light(known)
    again = [
        held(name, UNITS[0], n, light)[0]
        for name, n in (("ball 4 mm", 1.5), ("ball 4 mm", 4.0), ("face", 4.0))
    ]
    depth = [np.log(c.depth_mm / k.depth_mm) for c, k in zip(again, known, strict=True) if k.depth_mm]
    force = [np.log(c.force_n / k.force_n) for c, k in zip(again, known, strict=True)]
    assert abs(np.mean(depth)) < 0.01
    assert abs(np.mean(force)) < 0.01
    without_depth = calibrate_light([k._replace(depth_mm=None) for k in known])
    assert without_depth.terms == nominal_light().terms


def test_calibration_refuses_what_says_nothing() -> None:
    contact = held("bar", UNITS[0], 3.0)[0]
    with pytest.raises(InvalidValueError, match="0 presses"):
        calibrate_light([])
    with pytest.raises(InvalidValueError, match=r"press 0: force_n = 0\.0"):
        calibrate_light([KnownPress(contact, 0.0)])
    with pytest.raises(InvalidValueError, match="press 0: depth_mm = nan"):
        calibrate_light([KnownPress(contact, 1.0, float("nan"))])
    still = Gel(1).still()
    with pytest.raises(InvalidValueError, match="was not felt"):
        calibrate_light([KnownPress(TouchTracker(still).update(still), 1.0)])
