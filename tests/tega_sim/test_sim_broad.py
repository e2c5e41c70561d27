"""Recorded broad contacts of other DIGITs beside simulated ones: within the factors that are stated."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np

from tega_figures.broad import (
    TOLERANCES,
    Broad,
    recorded_disc,
    recorded_grasps,
    simulated_disc,
    simulated_grasps,
)
from tega_sim.gel import Gel


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
