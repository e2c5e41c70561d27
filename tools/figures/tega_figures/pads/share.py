"""Measure the share of each contact's area that the fingertip's camera sees in late holds.

``python -m tega_figures.pads.share --seeds 41:45`` prints two tables: the last second in which simulated people hold
an object, by object and finger; and scripted holds at each level, with forces and torques. Both use the simulated
hand's poses.

The area is that of the simulated gel, known up to 3.4 mm beyond the border of the picture (``Gel.in_view``). If a
finger is loaded and none of its contact lies on that, the share is 0.
"""

from __future__ import annotations

import argparse
from itertools import chain
from typing import TYPE_CHECKING, Final

import numpy as np

from tega.config import FINGERS
from tega_figures.pads.grip import grip
from tega_figures.touch_demo import KeptPictures
from tega_sim.lab import lab_of
from tega_sim.plan import TrialPlan, TrialResult
from tega_sim.trial import run_trial
from tega_sim.world.objects import OBJECTS
from tega_sim.world.poses import GRASP_POSES_RAD

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["level_table", "people_table", "shares_of_lift"]

LATE_S: Final = 1.0
LOADED_N: Final = 0.1
WANTED: Final = 0.95


def shares_of_lift(name: str, seed: int) -> tuple[TrialResult, list[NDArray[np.float64]]]:
    """Let a simulated person lift an object; measure the last second of the hold.

    Returns the lift and, for each finger, the share of the contact's area inside the picture, for every
    picture with 0.1 N or more, float64 (n,).
    """
    kept = KeptPictures(lab_of(seed, "live", ()))
    lift = run_trial(TrialPlan(object=name, seed=seed, rules=3), streams=kept)
    t_s = kept.array("truth", "t_s")
    held_s = t_s[kept.array("truth", "phase") == "hold"]
    end_s = float(held_s.max()) if held_s.size else 0.0
    found = []
    for finger in FINGERS:
        rows = np.array([(row[1], row[5]) for row in kept.seen if row[0] == finger])
        force_n = np.interp(rows[:, 0], t_s, kept.array("truth", f"{finger}_force_n"))
        late = (rows[:, 0] > end_s - LATE_S) & (rows[:, 0] <= end_s) & (force_n >= LOADED_N)
        found.append(np.nan_to_num(rows[late, 1]))
    return lift, found


def people_table(seeds: Sequence[int]) -> str:
    """Return the shares by object as a Markdown table, over people of these seeds."""
    lines = [
        "| last second of the hold | pictures | in the picture: thumb, index, middle, ring | pictures under 95 % "
        "| lifts held | slips | slid at most, mm | level |",
        "|---|---|---|---|---|---|---|---|",
    ]
    found = {name: [shares_of_lift(name, seed) for seed in seeds] for name in OBJECTS}
    for name, some in (*found.items(), ("all", list(chain(*found.values())))):
        lifts = [lift for lift, _ in some]
        fingers = [np.concatenate(parts) for parts in zip(*(shares for _, shares in some), strict=True)]
        shares = np.concatenate(fingers)
        means = fingers if name != "all" else [shares]
        cells = (
            name,
            len(shares),
            f"{', '.join(f'{100 * part.mean():.1f}' for part in means)} %",
            f"{np.mean(shares < WANTED):.1%}",
            f"{sum(lift.success for lift in lifts)} of {len(lifts)}",
            sum(lift.slips for lift in lifts),
            f"{1e3 * max(lift.slid_m for lift in lifts):.1f}",
            f"{np.mean([lift.mean_level for lift in lifts]):.2f}",
        )
        lines.append(f"| {' | '.join(map(str, cells))} |")
    return "\n".join(lines)


def level_table(poses_rad: NDArray[np.float64]) -> str:
    """Return shares, forces and torques of scripted holds at each level as a Markdown table.

    ``poses_rad`` are those of the five levels, (5, 16).
    """
    lines = [
        "| object, level | held | in the picture: thumb, index, middle, ring | pads, N | narrower, mm | slid, mm "
        "| largest torque | sum of torques |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for name in OBJECTS:
        for level in range(2, 6):
            one = grip(name, level, poses_rad, shares=True)
            cells = (
                f"{name}, {level}",
                "yes" if one.held else "no",
                f"{', '.join('–' if np.isnan(share) else f'{100 * share:.0f}' for share in one.share)} %",
                *(f"{value:.1f}" for value in (one.forces_n.sum(), one.narrowing_mm, one.slip_mm)),
                *(f"{value:.2f}" for value in (one.torques.max(), one.torques.sum())),
            )
            lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines)


def main() -> None:
    """Print both tables."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seeds", default="41:45", help="seeds of the people, first:end")
    first, end = map(int, options.parse_args().seeds.split(":"))
    print(people_table(range(first, end)), flush=True)
    print()
    print(level_table(GRASP_POSES_RAD))


if __name__ == "__main__":
    main()
