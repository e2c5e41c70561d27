"""``python -m tega_figures.world.check``: is the simulated world right?

Prints slip forces against their closed form, what levels and properties do, whether a repeat has the same bits, and
what stays bounded in a long hold; ``--pictures`` draws the three objects held.
"""

from __future__ import annotations

from pathlib import Path

import click
import numpy as np

from tega_figures.world.effects import effects, levels, slip_forces
from tega_figures.world.lift import LiftResult, lift
from tega_figures.world.rig import GRAVITY_M_S2, slip_force_n
from tega_figures.world.study import bounds
from tega_sim.world.objects import OBJECTS
from tega_sim.world.scene import Physics

__all__ = ["main"]


@click.command()
@click.option(
    "--long-s", default=600.0, show_default=True, help="Length of the long hold, simulated seconds."
)
@click.option("--pictures", type=click.Path(path_type=Path), help="Folder to draw into.")
@click.option(
    "--only",
    type=click.Choice(["forces", "levels", "effects", "flex", "repeat", "long"]),
)
def main(*, long_s: float, pictures: Path | None, only: str | None) -> None:
    """Check the simulated world and print what was found."""
    if only in (None, "forces"):
        _forces()
    if only in (None, "levels"):
        _levels()
    if only in (None, "effects"):
        _effects()
    if only in (None, "flex"):
        _flex()
    if only in (None, "repeat"):
        _repeat()
    if only in (None, "long"):
        _long(long_s)
    if pictures is not None:
        from tega_figures.world.pictures import draw_scene

        click.echo(f"drew {draw_scene(pictures)}")


def _forces() -> None:
    click.echo("Force of each of four pads at which the object slips, against m g / (4 µ)")
    for row in slip_forces():
        spec = row.spec
        click.echo(
            f"  {spec.name:10} {spec.mass_kg:5.2f} kg  µ {spec.friction:4.2f}  expected {row.expected_n:6.3f} N  "
            f"found {row.found_n:6.3f} N  ratio {row.found_n / row.expected_n:.3f}"
        )


def _levels() -> None:
    click.echo(
        "Lifts at each level: forces on the pads (thumb, index, middle, ring) and on the whole hand, newtons"
    )
    for name in OBJECTS:
        for level, one in enumerate(levels(name), start=2):
            gripped = max((truth for truth in one.trace if truth.t_s <= 4.0), key=lambda truth: truth.t_s)
            pads = " ".join(f"{force:4.1f}" for force in gripped.pad_force_n)
            outcome = "held" if one.held else "LOST"
            click.echo(
                f"  {name:10} level {level}  pads {pads}  hand {one.grip_force_n:5.1f}  {outcome}"
                f"  slip {1e3 * one.slip_m:5.1f} mm  narrower by {1e3 * one.narrowing_m:4.1f} mm"
                f"  stays {1e3 * one.damage_m:3.1f} mm"
            )


def _effects() -> None:
    click.echo(
        "One property changed at a time: lowest level that holds (6: none), and narrowing when gripped at level 4"
    )
    for row in effects():
        click.echo(
            f"  {row.name:10} {row.what:14} {row.values[0]:7g} -> {row.values[1]:7g}   level {row.needed[0]} -> "
            f"{row.needed[1]}   narrower by {1e3 * row.narrowing_m[0]:5.1f} -> {1e3 * row.narrowing_m[1]:5.1f} mm"
            f"   {'as it should' if row.right else 'WRONG'}"
        )


def _flex() -> None:
    click.echo("The bag as a flex, in steps of 3 and 0.75 ms, beside the bag of springs")
    bag = OBJECTS["bag"]
    flex = bag.with_(shell="flex")
    for changes in ({}, {"friction": 1.0}, {"mass_kg": 0.25}):
        spec = flex.with_(**changes)
        ratio = slip_force_n(spec) * 4 * spec.friction / (spec.mass_kg * GRAVITY_M_S2)
        click.echo(f"  {spec.mass_kg:5.2f} kg  µ {spec.friction:4.2f}  slips at {ratio:.3f} of m g / (4 µ)")
    fine = Physics(integrator="discrete", timestep_s=7.5e-4)
    for level in range(2, 6):
        for name, spec, physics in (("springs", bag, None), ("flex", flex, None), ("flex, fine", flex, fine)):
            one = lift(spec, level, physics=physics)
            gripped = max((truth for truth in one.trace if truth.t_s <= 4.0), key=lambda truth: truth.t_s)
            click.echo(
                f"  level {level}  {name:10}  {'held' if one.held else 'LOST'}  pads at most {one.peak_force_n:4.1f} N"
                f"  slip {1e3 * one.slip_m:4.1f} mm  narrower by {1e3 * gripped.deformation_m:4.1f} mm gripped, "
                f"{1e3 * one.narrowing_m:4.1f} mm at most  {one.cpu_us:4.0f} µs/ms"
            )
    held = bounds(flex, 3, seconds=60.0)
    click.echo(
        f"  held for {held.simulated_s:g} s: overlap {1e3 * held.penetration_m:.2f} mm, "
        f"sank {1e3 * held.slip_m:.2f} mm, finite {held.finite}, held {held.held}"
    )


def _repeat() -> None:
    first, second = (np.array([t[:4] for t in _flat(lift("bag", 4, seed=7))]) for _ in range(2))
    click.echo(f"Two runs of one seed have the same bits: {np.array_equal(first, second)}")


def _flat(one: LiftResult) -> list[tuple[float, ...]]:
    return [(t.t_s, t.object_height_m, t.slip_m, sum(t.pad_force_n)) for t in one.trace]


def _long(seconds: float) -> None:
    click.echo(f"Held for {seconds:g} s, a level more for 10 s in every 30")
    for name, level in (("bottle", 4), ("bag", 3)):
        found = bounds(name, level, seconds=seconds)
        click.echo(
            f"  {name:10} deepest overlap {1e3 * found.penetration_m:.2f} mm  kinetic energy at most "
            f"{1e3 * found.kinetic_j:.2f} mJ  sank {1e3 * found.slip_m:.2f} mm ({1e6 * found.slip_m_s:.1f} µm/s)  "
            f"finite {found.finite}  held {found.held}"
        )


if __name__ == "__main__":
    main()
