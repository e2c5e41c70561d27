"""Map which closures lose, let slip, hold and harm each object, from scripted lifts without a person.

``python -m tega_figures.world.feasible run map.json`` runs the lifts, ``… table map.json`` prints them as Markdown and
``… picture map.json map.png`` draws them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click
import msgspec
import numpy as np

from tega.sim.operator import VIEWS, ViewName, typical_person
from tega.sim.score import SLIP_M_S
from tega.sim.seams import WorldTruth
from tega.sim.world import ObjectSpec, read_objects
from tega_figures.world.lift import LiftResult, lift

LEVELS = (2, 3, 4, 5)
HOLD_S = 5.0
"""As long as a person holds."""

N_LOADS, N_WALLS = 7, 5

Grip = Literal["lost", "slips", "holds"]


class Closure(msgspec.Struct, frozen=True, kw_only=True):
    """Outcome of one scripted lift.

    Attributes:
        object: Name of the object.
        mass_kg: Of it, as the following.
        friction: Of it.
        stiffness_n_m: Of its wall.
        level: That the hand closed to.
        grip: ``lost``: dropped or left behind. ``slips``: held, with a slip that counts. ``holds``: held without.
        harmed: Whether it was narrowed by what harms it.
        slid_mm: Way slid since it left the table.
        fastest_mm_s: Of that.
        narrowed_mm: Most that it was narrowed.
        seen_ms: From the slide's beginning until a typical person's eyes have seen it, before the reaction, by view;
            missing where they never do.
        slid_unseen_mm: How far it had slid by then.
    """

    object: str
    mass_kg: float
    friction: float
    stiffness_n_m: float
    level: int
    grip: Grip
    harmed: bool
    slid_mm: float
    fastest_mm_s: float
    narrowed_mm: float
    seen_ms: dict[str, float]
    slid_unseen_mm: dict[str, float]


def closure(spec: ObjectSpec, level: int) -> Closure:
    """Lift an object at one level and say what came of it."""
    one = lift(spec, level, hold_s=HOLD_S)
    up = [truth for truth in one.trace if truth.lift_off]
    seen, unseen = {}, {}
    for view in VIEWS:
        found = _seen(up, view)
        if found is not None:
            seen[view], unseen[view] = (round(number, 1) for number in found)
    return Closure(
        object=spec.name,
        mass_kg=spec.mass_kg,
        friction=spec.friction,
        stiffness_n_m=spec.stiffness_n_m,
        level=level,
        grip=_grip(one),
        harmed=one.narrowing_m >= spec.harm_m,
        slid_mm=round(1e3 * max((truth.slip_m for truth in up), default=0.0), 2),
        fastest_mm_s=round(1e3 * max((truth.slip_m_s for truth in up), default=0.0), 1),
        narrowed_mm=round(1e3 * one.narrowing_m, 2),
        seen_ms=seen,
        slid_unseen_mm=unseen,
    )


def counts(closures: list[Closure], what: Literal["slips", "harm"]) -> bool:
    """Return whether a direction counts on an object: some closure fails in it, and some closure does not.

    Args:
        closures: Of one object at one mass, friction and stiffness, at every level.
        what: ``slips``: fails by slipping or being lost. ``harm``: fails by harm.
    """
    failed = {one.grip != "holds" if what == "slips" else one.harmed for one in closures}
    return failed == {True, False}


def variants(name: str) -> list[ObjectSpec]:
    """Return an object as it is, over its load (mass by friction), and over its wall's stiffness."""
    record = read_objects()[name]
    spec, ranges = record.spec, record.range
    (light, heavy), (slick, rough) = ranges["mass_kg"], ranges["friction"]
    loads = [
        spec.with_(mass_kg=round(float(mass), 4), friction=round(float(mu), 4))
        for mass, mu in zip(
            np.geomspace(light, heavy, N_LOADS), np.geomspace(rough, slick, N_LOADS), strict=True
        )
    ]
    soft, stiff = ranges["stiffness_n_m"]
    walls = [spec.with_(stiffness_n_m=round(float(wall), 1)) for wall in np.geomspace(soft, stiff, N_WALLS)]
    return [spec, *loads, *walls]


@click.group(help=__doc__)
def main() -> None:
    """Group of the commands."""


@main.command("run")
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
def run(file: Path) -> None:
    """Run the lifts of every object, and write FILE."""
    found = [[closure(spec, level) for level in LEVELS] for name in read_objects() for spec in variants(name)]
    file.write_bytes(msgspec.json.format(msgspec.json.encode(found), indent=0))


@main.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
def table(file: Path) -> None:
    """Print FILE as Markdown: each object as it is, then what counts over its ranges."""
    click.echo(table_text(_read(file)))


@main.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.argument("png", type=click.Path(dir_okay=False, path_type=Path))
def picture(file: Path, png: Path) -> None:
    """Draw FILE: closure level against load and against stiffness, a row an object."""
    from matplotlib.figure import Figure
    from matplotlib.patches import Patch, Rectangle

    found = _read(file)
    colour = {"lost": "#c8202f", "slips": "#e8a33d", "holds": "#3f8f5a"}
    names = list(dict.fromkeys(rows[0].object for rows in found))
    figure = Figure(figsize=(9, 2.3 * len(names) + 0.6), layout="constrained")
    axes = figure.subplots(len(names), 2, squeeze=False, width_ratios=(N_LOADS, N_WALLS))
    for name, row in zip(names, axes, strict=True):
        _, *rest = [rows for rows in found if rows[0].object == name]
        for part, axis in zip((rest[:N_LOADS], rest[N_LOADS:]), row, strict=True):
            for x, rows in enumerate(part):
                for one in rows:
                    axis.add_patch(Rectangle((x - 0.5, one.level - 0.5), 1, 1, color=colour[one.grip]))
                    if one.harmed:
                        axis.text(x, one.level, "harm", ha="center", va="center", fontsize=7)
            axis.set(xlim=(-0.5, len(part) - 0.5), ylim=(1.5, 5.5), yticks=LEVELS)
        row[0].set_ylabel(f"{name}\nlevel")
        row[0].set_xticks(
            range(N_LOADS), [f"{r[0].mass_kg:.2g}\n{r[0].friction:.2g}" for r in rest[:N_LOADS]], fontsize=7
        )
        row[1].set_xticks(
            range(N_WALLS), [f"{r[0].stiffness_n_m / 1e3:.2g}" for r in rest[N_LOADS:]], fontsize=7
        )
    axes[-1][0].set_xlabel("mass kg over friction: easier to harder")
    axes[-1][1].set_xlabel("wall under a fingertip N/mm")
    figure.legend(
        handles=[Patch(color=shade, label=grip) for grip, shade in colour.items()],
        loc="outside upper right",
        ncols=3,
        frameon=False,
    )
    figure.suptitle("What scripted closures do to each object (simulated)", x=0.02, ha="left", fontsize=10)
    figure.savefig(png, dpi=110)


def table_text(found: list[list[Closure]]) -> str:
    """Return the map as Markdown: closures of each object as it is, and what counts in every variant."""
    lines = [
        "| object | level | | slid mm | fastest mm/s | seen after ms: direct, aside | slid by then mm | narrower mm |",
        "|---|---|---|---|---|---|---|---|",
    ]
    names = list(dict.fromkeys(rows[0].object for rows in found))
    for name in names:
        for one in next(rows for rows in found if rows[0].object == name):
            shown = [
                ", ".join(f"{of[view]:.0f}" if view in of else "–" for view in ("direct", "aside"))
                for of in (one.seen_ms, one.slid_unseen_mm)
            ]
            lines.append(
                f"| {name} | {one.level} | {one.grip}{', harmed' if one.harmed else ''} | {one.slid_mm:.1f} "
                f"| {one.fastest_mm_s:.0f} | {shown[0]} | {shown[1]} | {one.narrowed_mm:.1f} |"
            )
    lines += [
        "",
        "| object | mass kg | friction | wall N/mm | "
        + " | ".join(f"level {level}" for level in LEVELS)
        + " | slips count | harm counts |",
        "|---" * (len(LEVELS) + 6) + "|",
    ]
    for rows in found:
        one = rows[0]
        cells = [f"{r.grip}{', harmed' if r.harmed else ''}" for r in rows]
        verdicts = ["yes" if counts(rows, what) else "no" for what in ("slips", "harm")]
        lines.append(
            f"| {one.object} | {one.mass_kg:.2f} | {one.friction:.2f} | {one.stiffness_n_m / 1e3:.2f} | "
            f"{' | '.join([*cells, *verdicts])} |"
        )
    return "\n".join(lines)


def _grip(one: LiftResult) -> Grip:
    if not one.held:
        return "lost"
    return "slips" if one.slips else "holds"


def _seen(up: list[WorldTruth], view: ViewName) -> tuple[float, float] | None:
    """Return when, after the first slide began, eyes have seen it, ms, and how far it had slid since, mm."""
    eyes, sight = typical_person().vision, VIEWS[view]
    onset = next((k for k, truth in enumerate(up) if truth.slip_m_s >= SLIP_M_S), None)
    if onset is None or not sight.seen:
        return None
    motion, last = 0.0, up[onset]
    for truth in up[onset:]:
        dt_s, last = truth.t_s - last.t_s, truth
        w = np.degrees(max(truth.slip_m_s, 0.0)) / eyes.distance_m / sight.blur
        motion += (w ** (2 / 3) if w > eyes.motion_floor_deg_s else 0.0) * dt_s
        motion -= motion * dt_s / eyes.motion_leak_s
        if motion > eyes.motion_c:
            return 1e3 * (truth.t_s - up[onset].t_s), 1e3 * (truth.slip_m - up[onset].slip_m)
    return None


def _read(file: Path) -> list[list[Closure]]:
    return msgspec.json.decode(file.read_bytes(), type=list[list[Closure]])


if __name__ == "__main__":
    main()
