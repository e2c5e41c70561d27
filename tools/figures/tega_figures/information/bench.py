"""Compare the arms of simulated trials of the bench with no vest, person by person, as the plant's are compared."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega_figures.information.compare import OUTCOMES, null, paired
from tega_sim.conditions import Condition
from tega_sim.operator import RulesVersion, draw_person
from tega_sim.plan import TrialResult

OFF: Final[Condition] = "non-haptic"


class ArmOutcomes(NamedTuple):
    """Outcomes of the people under one condition.

    Attributes:
        rules: Version of the rules that they followed.
        condition: The arm.
        seeds: Who.
        rows: A row a person: :data:`OUTCOMES`, and the share of trials in which the object was lifted and held.
    """

    rules: RulesVersion
    condition: str
    seeds: list[int]
    rows: list[list[float]]


def bench_arms(results: Sequence[TrialResult]) -> list[ArmOutcomes]:
    """Return each arm's outcomes, means over a person's trials, in the order in which arms first come.

    Slips and the share of trials with deformation are counted by the scorer; effort is the mean closure level from
    lift-off until the object was put down, as a share of full, 0 where it never left the table; the cost has the
    person's own weights.
    """
    trials: defaultdict[tuple[RulesVersion, str], defaultdict[int, list[list[float]]]] = defaultdict(
        lambda: defaultdict(list)
    )
    for r in results:
        counted = [r.slips, float(r.deformations > 0), r.mean_level / 5, 0.0, float(r.success)]
        trials[r.rules, r.condition][r.seed].append(counted)
    arms = []
    for (rules, condition), people in trials.items():
        rows = []
        for seed, of_person in people.items():
            slips, harm, effort, _, lifted = np.mean(of_person, axis=0).tolist()
            grip = draw_person(seed).grip
            cost = slips + grip.harm_cost * harm + grip.effort_cost * effort
            rows.append([round(one, 6) for one in (slips, harm, effort, cost, lifted)])
        arms.append(ArmOutcomes(rules, condition, list(people), rows))
    return arms


def bench_table(arms: Sequence[ArmOutcomes]) -> str:
    """Return what happens without a vest, and every arm's difference from that within people, as Markdown."""
    lines = [f"| rules | condition | {' | '.join(OUTCOMES)} | null | lifted |", "|---" * 8 + "|"]
    for arm in sorted(arms, key=lambda one: (one.rules, one.condition != OFF)):
        rows = np.array(arm.rows)
        if arm.condition == OFF:
            cells = [f"{mean:.2f}" for mean in rows.mean(axis=0)[:4]]
            verdict = ""
        else:
            found = paired(rows[:, :4], _without(arms, arm))
            cells = [f"{d.mean:+.2f} ({d.low:+.2f} to {d.high:+.2f})" for d in found.values()]
            verdict = "yes" if null(found) else "no"
        told = [str(arm.rules), f"`{arm.condition}`", *cells, verdict, f"{rows[:, 4].mean():.0%}"]
        lines.append(f"| {' | '.join(told)} |")
    return "\n".join(lines)


def _without(arms: Sequence[ArmOutcomes], arm: ArmOutcomes) -> NDArray[np.float64]:
    """Return the same people's outcomes without a vest, by the same rules."""
    off = next(one for one in arms if one.rules == arm.rules and one.condition == OFF)
    of = dict(zip(off.seeds, off.rows, strict=True))
    return np.array([of[seed][:4] for seed in arm.seeds])
