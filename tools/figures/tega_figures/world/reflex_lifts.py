"""Lift objects at the level at which they slip, by a script without error: without a reflex, and with one.

The reflex is told the true speed of the slide, or reads the shear of the fingertips' pictures.

``python -m tega_figures.world.reflex_lifts`` prints the table of docs/evidence/reflex.md.
"""

from __future__ import annotations

from typing import Final

import click
import numpy as np

from tega.sim.conditions import Condition
from tega.sim.lab import lab_of
from tega.sim.lift import Lift
from tega.sim.operator.scripted import ScriptedOperator, Step
from tega.sim.plan import TrialPlan
from tega.sim.seams import Act, Percept, Shear
from tega.sim.streams import Streams

LIFTS: Final = (("bottle", 3), ("container", 2), ("bag", 2))
"""Objects, each at the level at which it slips and is held, by the feasibility map."""

ARMS: Final[tuple[tuple[Condition, float, str], ...]] = (
    ("non-haptic", 0.0, "none"),
    ("true-reflex", 0.5, "true slide, 0.5 levels at most"),
    ("true-reflex", 1.0, "true slide, 1 level at most"),
    ("reflex", 1.0, "shear, 1 level at most"),
)
"""Condition, the largest addition, levels, and what the reflex goes by: ``reflex`` reads shear."""

_SEED: Final = 3


class _Closed(Streams):
    """Keeps how far the hand was closed while the object was held."""

    def __init__(self) -> None:
        super().__init__()
        self.levels_closed: list[float] = []

    def act(self, percept: Percept, act: Act) -> None:
        if act.phase in {"lift", "hold"} and percept.closure is not None:
            self.levels_closed.append(percept.closure)


def lift_row(name: str, level: int, condition: Condition, most_levels: float, told: str) -> str:
    """Lift an object once and return its line of the table."""
    sets: tuple[str, ...] = ()
    shear: Shear = "texture" if condition == "reflex" else "off"
    if most_levels > 0:
        sets = (
            "stages.reflex.name=grip",
            "stages.reflex.authority=1",
            f"stages.reflex.most_levels={most_levels}",
        )
    if shear != "off":
        sets += ("stages.metric.name=shear",)
    plan = TrialPlan(
        object=name, condition=condition, seed=_SEED, operator="scripted", settings=sets, shear=shear
    )
    lab = lab_of(_SEED, "live", sets, shear)
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
    closed = _Closed()
    run = Lift(lab, plan, script, 0, streams=closed)
    run.go(real_time=False, observer=None, stop=lambda: False, paused=lambda: False)
    found = run.result(run.end_s)
    return (
        f"| {name} | {level} | {told} | {1e3 * found.slid_m:.1f} | {found.slips} | {found.drops} | "
        f"{np.mean(closed.levels_closed):.2f} |"
    )


@click.command(help=__doc__)
def main() -> None:
    """Print the table."""
    click.echo(
        "| object | level | reflex by | slid mm | slips | drops | closed, levels |\n|---|---|---|---|---|---|---|"
    )
    for name, level in LIFTS:
        for condition, most_levels, told in ARMS:
            click.echo(lift_row(name, level, condition, most_levels, told))


if __name__ == "__main__":
    main()
