"""What the simulated touch is worth: closed form, published force and depth, recorded presses, what live reads."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from tega import _native
from tega.errors import InvalidValueError
from tega.tactile import read_contact
from tega_figures.broad import (
    TOLERANCES,
    Broad,
    recorded_disc,
    recorded_grasps,
    simulated_disc,
    simulated_grasps,
)
from tega_figures.check_touch import (
    GOLDEN,
    GOLDEN_RADIUS_MM,
    RecordedPresses,
    ball_press,
    like_presses,
    load_presses,
    readings,
)
from tega_figures.closeness import match_press
from tega_figures.gel_sequences import SHAPES, press_sequence, ramp
from tega_sim.gel import PX_PER_MM, Gel, ball


@pytest.fixture(scope="module")
def presses(recordings: Path) -> RecordedPresses:
    return load_presses(recordings / "digit" / "digit_ball_D20641")


@pytest.mark.parametrize("radius_mm", [4.4, 12.0, 33.0])
@pytest.mark.parametrize("contact_mm", [1.2, 1.8, 2.4])
def test_a_ball_goes_in_and_touches_as_the_closed_form_says(radius_mm: float, contact_mm: float) -> None:
    depth_mm, force_n = ball_press(radius_mm, contact_mm)
    truth = Gel(1, shape="flat").press([ball(force_n=force_n, radius_mm=radius_mm)])
    # A ball is not its paraboloid: deeper in it is steeper.
    assert truth.depth_mm == pytest.approx(depth_mm, rel=0.04)
    # Half a cell is 0.11 mm.
    assert (truth.area_mm2 / np.pi) ** 0.5 == pytest.approx(contact_mm, abs=0.12)


def test_the_skin_beside_a_ball_falls_off_as_a_bessel_function() -> None:
    from scipy.special import k1

    gel = Gel(1, shape="flat")
    truth = gel.press([ball(force_n=3.0)])
    height = gel.displacement_mm()
    middle = (height[39] + height[40]) / 2
    slope = -np.diff(middle[30:]) / (4 / PX_PER_MM)
    at_mm = (np.arange(1, slope.size + 1)) * 4 / PX_PER_MM
    contact_mm = (truth.area_mm2 / np.pi) ** 0.5
    beside = (at_mm > contact_mm + 0.3) & (at_mm < contact_mm + 2.5)
    expected = k1(at_mm[beside] / _native.GEL_LENGTH_MM)
    ratio = slope[beside] / expected
    assert ratio / ratio.mean() == pytest.approx(np.ones(ratio.size), abs=0.05)


def test_force_and_depth_are_those_of_a_published_test() -> None:
    gel = Gel(1, shape="flat")
    forces = np.geomspace(0.5, 40, 60)
    depths = [gel.press([ball(force_n=n, radius_mm=GOLDEN_RADIUS_MM)]).depth_mm for n in forces]
    simulated = np.interp([depth for depth, _ in GOLDEN], depths, forces)
    measured = np.array([force for _, force in GOLDEN])
    assert simulated / measured == pytest.approx(np.ones(4), abs=0.12)
    exponents = [
        np.log(b / a) / np.log(y / x)
        for (x, a), (y, b) in pairwise(zip(np.arange(1, 5) / 2, simulated, strict=True))
    ]
    assert all(1.6 < exponent < 2.1 for exponent in exponents)


def test_live_follows_what_is_true() -> None:
    gel = Gel(3)
    for name, over_dent in (
        ("ball 4.4 mm", (0.9, 1.2)),
        ("ball 12 mm", (0.9, 1.15)),
        ("cylinder 3 mm", (0.9, 1.1)),
    ):
        seen = [r for r in readings(name, gel) if r.eda]
        assert len(seen) >= 5, name
        assert [r.eda for r in seen] == sorted(r.eda for r in seen)
        assert [r.cci for r in seen] == sorted(r.cci for r in seen)
        assert [r.area_px for r in seen] == sorted(r.area_px for r in seen)
        assert all(over_dent[0] < r.eda / r.dent_px < over_dent[1] for r in seen), name


def test_a_flat_face_keeps_its_area_and_an_edge_is_sharper_than_a_face() -> None:
    gel = Gel(3)
    # Lighter it lies on the gel's top alone.
    flat = [r for r in readings("flat 5 x 5 mm", gel) if r.force_n >= 3]
    # 5 mm are 23.4 cells.
    assert {round((r.area_px / 16) ** 0.5) for r in flat} <= {23, 24}
    edge = {r.force_n: r.cci for r in readings("edge", gel)}
    assert all(edge[r.force_n] > 1.5 * r.cci for r in flat if r.eda)


def test_untouched_frames_are_never_contact() -> None:
    for seed in range(3):
        gel = Gel(seed)
        still = gel.frame([], 0)
        assert all(read_contact(gel.frame([], n * 37), still).eda == 0 for n in range(1, 60))


@pytest.mark.slow
def test_simulated_presses_are_close_to_recorded_ones(presses: RecordedPresses) -> None:
    gel = Gel(0, spread=0.0)
    picked = range(0, len(presses.frames), 6)
    found = [
        match_press(presses.frames[k], presses.still, presses.marks[k], gel, index=100 * k) for k in picked
    ]
    assert np.median([m.score for m in found]) <= 0.6
    assert max(m.score for m in found) <= 1
    assert max(max(m.off.values()) for m in found) <= 3
    assert min(m.correlation for m in found) >= 0.85
    assert np.median([m.correlation for m in found]) >= 0.9


def test_a_ball_pressed_to_a_like_difference_covers_what_was_marked(presses: RecordedPresses) -> None:
    some = RecordedPresses(presses.still, presses.frames[::6], presses.marks[::6])
    areas, touching, _ = zip(*like_presses(some, Gel(0, spread=0.0)), strict=True)
    assert 0.85 < np.median(areas) < 1.15
    # The marks are where the dent ends; the gel touches on some 0.53 to 0.70 of their area.
    assert 0.5 < np.median(touching) < 0.75


CURVE = ramp(peak_n=2.0, wait_s=0.1, rise_s=0.2, hold_s=0.2, fall_s=0.1)


@pytest.mark.parametrize("name", SHAPES)
def test_a_sequence_is_labelled_from_before_the_press_to_after(name: str) -> None:
    moments = list(press_sequence(name, seed=3, force_n=CURVE, duration_s=1.0))
    assert [m.t_s for m in moments] == [k / 60 for k in range(60)]
    assert [m.force_n for m in moments] == [CURVE(m.t_s) for m in moments]
    assert [m.touches for m in moments] == [m.force_n > 0 for m in moments]
    assert not any(m.area_px or m.depth_mm for m in moments if not m.force_n)
    held = [m for m in moments if m.force_n == 2.0]
    assert all(m.area_px > 0 and m.depth_mm > 0.05 and np.isfinite(m.centre_xy).all() for m in held)
    # It creeps.
    assert held[-1].depth_mm > held[0].depth_mm
    # Something is left after release, which the truth does not call touch.
    after = Gel(3, memory=True).frame([], 55)
    assert not np.array_equal(moments[55].image, after)
    assert len({id(m.image) for m in moments}) == 60


def test_a_sequence_of_another_rate_and_place_is_the_same_press() -> None:
    slow = list(press_sequence("ball 4 mm", seed=1, force_n=CURVE, duration_s=0.5, rate_hz=20.0, start_s=2.0))
    assert len(slow) == 10
    beside = next(
        m
        for m in press_sequence("ball 4 mm", seed=1, force_n=CURVE, duration_s=0.5, centre_xy=(160.0, 100.0))
        if m.force_n == 2.0
    )
    assert 140 < beside.centre_xy[0] < 160
    assert abs(beside.centre_xy[1] - 100.0) < 10


def test_bad_arguments_are_refused() -> None:
    with pytest.raises(InvalidValueError, match="'pear' is not known"):
        next(press_sequence("pear", seed=1, force_n=CURVE, duration_s=1.0))
    with pytest.raises(InvalidValueError, match="rate_hz = 0"):
        next(press_sequence("bar", seed=1, force_n=CURVE, duration_s=1.0, rate_hz=0))


def ratio(of: str, recorded: list[Broad], simulated: list[Broad]) -> float:
    one, two = (np.nanmedian([getattr(found, of) for found in some]) for some in (recorded, simulated))
    return float(max(one / two, two / one))


def test_a_disc_pressed_harder_changes_the_picture_as_the_recorded_one_does(recordings: Path) -> None:
    # The picture trails the force by some frames where it rises fast: the later half is compared.
    late = [
        (force, one) for force, one in recorded_disc(recordings / "digit" / "digit_disc_force") if force > 7
    ]
    forces = [force for (before, _), (force, _) in pairwise(late) if force - before > 0.5]
    recorded = [next(one for force, one in late if force == wanted) for wanted in forces]
    units = [simulated_disc(Gel(seed), forces, baseline_n=1.08) for seed in (1, 2, 3)]
    for k, one in enumerate(recorded):
        simulated = [unit[k] for unit in units]
        for of, factor in TOLERANCES.items():
            assert ratio(of, [one], simulated) < factor, (of, forces[k])
    for unit in (recorded, *units):
        assert all(a.mean < b.mean and a.share < b.share for a, b in pairwise(unit))


def test_grasps_change_as_much_of_the_picture_and_as_steeply(recordings: Path) -> None:
    recorded = recorded_grasps(recordings / "digit" / "derived" / "digit_grasp_masks")
    simulated = simulated_grasps()
    for of, factor in TOLERANCES.items():
        assert ratio(of, recorded, simulated) < factor, of
        spans = [
            [np.nanmin(v), np.nanmax(v)] for v in ([getattr(b, of) for b in s] for s in (recorded, simulated))
        ]
        # Every recorded grasp lies among the simulated ones, or a quarter outside.
        assert spans[0][0] > 0.75 * spans[1][0], of
        assert spans[0][1] < 1.25 * spans[1][1], of
