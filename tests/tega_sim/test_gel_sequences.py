"""Labelled touch sequences: every shape, forces, truth, the same bits again."""

from __future__ import annotations

import numpy as np
import pytest

from tega.errors import InvalidValueError
from tega_figures.gel_sequences import SHAPES, press_sequence, ramp
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
