"""Lift objects at the level at which they slip, by a script without error, without and with a reflex told true slips.

``python -m tega_figures.world.reflex_lifts`` prints the table of docs/evidence/reflex.md.
"""

from __future__ import annotations

from typing import Final

import click

from tega.sim.conditions import Condition
from tega.sim.lab import lab_of
from tega.sim.lift import Lift
from tega.sim.operator.scripted import ScriptedOperator, Step
from tega.sim.plan import TrialPlan

LIFTS: Final = (("bottle", 3), ("container", 2), ("bag", 2))
"""Objects, each at the level at which it slips and is held, by the feasibility map."""

ARMS: Final[tuple[tuple[Condition, float], ...]] = (
    ("non-haptic", 0.0),
    ("true-reflex", 0.5),
    ("true-reflex", 1.0),
)
"""Condition, and the largest addition, levels."""

_SEED: Final = 3


def lift_row(name: str, level: int, condition: Condition, most_levels: float) -> str:
    """Lift an object once and return its line of the table."""
    sets: tuple[str, ...] = ()
    if most_levels > 0:
        sets = (
            "stages.reflex.name=grip",
            "stages.reflex.authority=1",
            f"stages.reflex.most_levels={most_levels}",
        )
    plan = TrialPlan(object=name, condition=condition, seed=_SEED, operator="scripted", settings=sets)
    lab = lab_of(_SEED, "live", sets)
    course = (
        Step(0.0, "reach", 1, (0.0, 0.0), 1.2),
        Step(1.5, "grasp", level, (0.0, 0.0), 0.0),
        Step(3.0, "lift", level, (0.22, 0.0), 2.0),
        Step(5.0, "hold", level, (0.22, 0.0), 0.0),
        Step(10.0, "place", level, (0.0, 0.0), 2.0),
        Step(12.2, "release", 1, (0.0, 0.0), 0.0),
        Step(13.0, "done", 1, (0.0, 0.0), 0.0),
    )
    script = ScriptedOperator(course, full_effort=lab.calibrated.full_effort)
    run = Lift(lab, plan, script, 0)
    run.go(real_time=False, observer=None, stop=lambda: False, paused=lambda: False)
    found = run.result(run.end_s)
    told = f"reflex, {most_levels:g} levels at most" if most_levels > 0 else "none"
    return f"| {name} | {level} | {told} | {1e3 * found.slid_m:.1f} | {found.slips} | {found.drops} |"


@click.command(help=__doc__)
def main() -> None:
    """Print the table."""
    click.echo("| object | level | reflex | slid mm | slips | drops |\n|---|---|---|---|---|---|")
    for name, level in LIFTS:
        for condition, most_levels in ARMS:
            click.echo(lift_row(name, level, condition, most_levels))


if __name__ == "__main__":
    main()
