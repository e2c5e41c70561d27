"""Lift objects by a script without error, where they slip and where they are held: without a reflex, and with one.

The reflex goes by the true speed of the slide, by the share that the fingertips' pictures show to have slid or by its
rise, or by the rise of the share that has truly slid. A constant addition is the control: what it prevents at the same
closure no reflex has to.

``python -m tega_figures.world.reflex_lifts`` prints the tables of docs/evidence/mappings.md.
"""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import click
import numpy as np

from tega.records import Contact, Event
from tega.stages.base import Reflex
from tega_figures.information.controls import SOFTEST
from tega_sim.conditions import Condition
from tega_sim.lab import lab_of
from tega_sim.lift import Lift
from tega_sim.operator.scripted import ScriptedOperator, Step
from tega_sim.plan import TrialPlan
from tega_sim.seams import Act, Percept
from tega_sim.world import OBJECTS

LIFTS: Final = (
    ("bottle", 3), ("container", 2), ("bag", 2), ("bottle", 4), ("container", 3), ("bag", 3),
    ("soft-bag", 2), ("soft-bag", 3), ("soft-bag", 4),
)  # fmt: skip
"""Objects, each at the level at which it slips and is held, and at one that holds, by the feasibility map; and the bag
with the softest wall of its range, which the first level leaves on the table and the last deforms."""

RISE_FROM: Final = 0.15
"""Of the share that has slid; chosen on the lifts of seed 3."""

FELT_LEVELS: Final = 0.02
"""An addition counts as begun when it is larger than this, levels."""


class Firming(NamedTuple):
    """One way to firm the grip.

    Attributes:
        told: What the reflex goes by.
        condition: Of the trial.
        most_levels: The largest addition; 0 for none.
        options: Of ``grip``.
        rates: Of the addition, levels a second: up, down.
        shear: Whether the gels give way sideways, and the metric reads by how much.
        constant: Whether all that may be added is wished for as long as a finger touches.
    """

    told: str
    condition: Condition = "non-haptic"
    most_levels: float = 0.0
    options: tuple[str, ...] = ()
    rates: tuple[float, float] = (5.0, 0.5)
    shear: bool = False
    constant: bool = False


_RISE: Final = (f"rise_from={RISE_FROM}", "full_slip_mm_s=1000")
# As fast up as the settings allow, kept for 0.2 s and soon down again.
_SHORT: Final = (10.0, 2.0)
_KEPT: Final = ("keep_s=0.2",)
ARMS: Final = (
    Firming("none"),
    Firming("true slide", "true-reflex", 1.0),
    Firming("shear, share that has slid", "reflex", 1.0, ("full_slip_mm_s=1000",), shear=True),
    Firming("shear, rise of that share", "reflex", 1.0, _RISE, shear=True),
    Firming("rise of the true share", "true-reflex", 1.0, _RISE, shear=True),
    Firming("short: true slide", "true-reflex", 1.0, _KEPT, _SHORT),
    Firming("short: shear, rise of that share", "reflex", 1.0, (*_RISE, *_KEPT), _SHORT, shear=True),
    Firming("short: rise of the true share", "true-reflex", 1.0, (*_RISE, *_KEPT), _SHORT, shear=True),
    *(
        Firming(f"constant, {most:g} levels", "true-reflex", most, constant=True)
        for most in (0.1, 0.2, 0.35, 0.5, 0.75)
    ),
)


class Always(Reflex):
    """Wishes all that may be added as long as a finger touches."""

    def wish(
        self,
        t_ns: int,  # noqa: ARG002
        own: float,  # noqa: ARG002
        measured: float | None,  # noqa: ARG002
        contacts: Mapping[str, Contact],
        events: Sequence[Event],  # noqa: ARG002
    ) -> float:
        """Return the wish, see :meth:`tega.stages.Reflex.wish`."""
        return float(any(one.in_contact for one in contacts.values()))


class _WatchedScript(ScriptedOperator):
    """Keeps, while the object is lifted and held, how far the hand is closed, what is added, and where it slides."""

    run: Lift

    def begin(self, *words: object, **more: object) -> None:
        super().begin(*words, **more)  # type: ignore[arg-type]
        self.levels_closed: list[float] = []
        self.added: list[tuple[float, float]] = []
        self.slid_s: float | None = None

    def act(self, percept: Percept) -> Act:
        act = super().act(percept)
        if act.phase in {"grasp", "lift", "hold"}:
            arc = self.run._reflex  # noqa: SLF001  # what a lift adds is shown nowhere else without pictures
            self.added.append((percept.t_s, 0.0 if arc is None else arc.added))
        if act.phase in {"lift", "hold"}:
            if percept.closure is not None:
                self.levels_closed.append(percept.closure)
            if self.slid_s is None and percept.scene.slip_m > 3e-4:
                self.slid_s = percept.t_s
        return act


_SPECS: Final = {**OBJECTS, **{spec.name: spec for spec in SOFTEST.values()}}


def lift_row(name: str, level: int, arm: Firming, seed: int) -> str:
    """Lift an object once and return its line of the table."""
    sets: tuple[str, ...] = ("stages.metric.name=shear",) if arm.shear else ()
    if arm.most_levels > 0:
        sets += (
            "stages.reflex.name=grip",
            "stages.reflex.authority=1",
            f"stages.reflex.most_levels={arm.most_levels}",
            f"stages.reflex.rise_levels_per_s={arm.rates[0]}",
            f"stages.reflex.fall_levels_per_s={arm.rates[1]}",
        )
        sets += tuple(f"stages.reflex.options.{one}" for one in arm.options)
    plan = TrialPlan.checked(
        {
            "object": name,
            "spec": _SPECS[name],
            "condition": arm.condition,
            "seed": seed,
            "operator": "scripted",
            "settings": sets,
            "shear": "texture" if arm.shear else "off",
        }
    )
    lab = lab_of(seed, "live", sets, plan.shear)
    course = (
        Step(0.0, "reach", 1, (0.0, 0.0), 1.2),
        Step(1.5, "grasp", level, (0.0, 0.0), 0.0),
        Step(3.0, "lift", level, (0.22, 0.0), 2.0),
        Step(5.0, "hold", level, (0.22, 0.0), 0.0),
        Step(10.0, "place", level, (0.0, 0.0), 2.0),
        Step(12.2, "release", 1, (0.0, 0.0), 0.0),
        Step(13.0, "done", 1, (0.0, 0.0), 0.0),
    )
    script = _WatchedScript(course, full_effort=lab.calibrated.full_effort)
    script.run = run = Lift(lab, plan, script, 0)
    if arm.constant:
        run._reflex.reflex = Always()  # type: ignore[union-attr]  # noqa: SLF001
    run.go(real_time=False, observer=None, stop=lambda: False, paused=lambda: False)
    found = run.result(run.end_s)
    added = script.added
    begun = [b[0] for a, b in itertools.pairwise(added) if a[1] <= FELT_LEVELS < b[1]]
    on = np.mean([levels > FELT_LEVELS for _, levels in added]) if added else 0.0
    times = ", ".join(f"{t_s:.2f}" for t_s in begun[:4]) + (" …" if len(begun) > 4 else "")
    slides = "–" if script.slid_s is None else f"{script.slid_s:.2f}"
    return (
        f"| {seed} | {name} | {level} | {arm.told} | {1e3 * found.slid_m:.1f} | {found.slips} | {found.drops} | "
        f"{np.mean(script.levels_closed):.2f} | {slides} | {times or '–'} | {on:.0%} |"
    )


@click.command(help=__doc__)
@click.option("--seeds", default="4,5", show_default=True, help="Of world and gels, with commas.")
@click.option("--told", default="", help="Only arms whose name has this in it.")
@click.option("--object", "of", default="", help="Only objects whose name has this in it.")
def main(*, seeds: str, told: str, of: str) -> None:
    """Print the table."""
    click.echo(
        "| seed | object | level | reflex by | slid mm | slips | drops | closed, levels | slides from, s "
        "| addition begins, s | of the time |\n|" + "---|" * 11
    )
    for seed in map(int, seeds.split(",")):
        for name, level in LIFTS:
            for arm in ARMS:
                if told in arm.told and of in name:
                    click.echo(lift_row(name, level, arm, seed))


if __name__ == "__main__":
    main()
