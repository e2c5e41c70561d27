"""Sequences of the simulated gel, and broad contacts against recorded ones."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from tega.errors import InvalidValueError
from tega_figures.gel_sequences import (
    SHAPES,
    TOLERANCES,
    Broad,
    press_sequence,
    ramp,
    recorded_disc,
    recorded_grasps,
    simulated_disc,
    simulated_grasps,
)
from tega_sim.gel import Gel

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
