"""Map which levels lose, let slip, hold and harm each object, from scripted lifts without a person.

``python -m tega_figures.world.feasible run map.json`` runs the lifts, ``… table map.json`` prints them as Markdown and
``… picture map.json map.png`` draws them.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Literal, get_args

import click
import msgspec
import numpy as np

from tega.runtime.files.foreign_file import read_foreign
from tega_figures.world.lift import LiftResult, lift
from tega_sim.operator import VIEWS, ViewName, typical_person
from tega_sim.operator.vision import Eyes
from tega_sim.score import SLIP_M_S
from tega_sim.seams import WorldTruth
from tega_sim.world import ObjectSpec, read_objects

LEVELS = (2, 3, 4, 5)
HOLD_S = 5.0
"""As long as a person holds."""

N_LOADS, N_WALLS = 7, 5

Grip = Literal["lost", "slips", "holds"]
Failure = Literal["slips", "harm"]
FAILURES: tuple[Failure, ...] = get_args(Failure)


class LevelOutcome(msgspec.Struct, frozen=True, kw_only=True):
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
    seen_ms: dict[ViewName, float]
    slid_unseen_mm: dict[ViewName, float]


def try_level(spec: ObjectSpec, level: int) -> LevelOutcome:
    """Lift an object at one level and say what came of it."""
    one = lift(spec, level, hold_s=HOLD_S)
    up = [truth for truth in one.trace if truth.lift_off]
    seen = {view: found for view in VIEWS if (found := _seen(up, view)) is not None}
    return LevelOutcome(
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
        seen_ms={view: round(after_ms, 1) for view, (after_ms, _) in seen.items()},
        slid_unseen_mm={view: round(slid_mm, 1) for view, (_, slid_mm) in seen.items()},
    )


def counts(levels: Sequence[LevelOutcome], what: Failure) -> bool:
    """Return whether a direction counts on an object: some level fails in it, and some level does not.

    Args:
        levels: Of one object at one mass, friction and stiffness, at every level.
        what: ``slips``: fails by slipping or being lost. ``harm``: fails by harm.
    """
    failed = {one.grip != "holds" if what == "slips" else one.harmed for one in levels}
    return failed == {True, False}


def variants(name: str) -> list[ObjectSpec]:
    """Return an object as it is, over its load (mass by friction), and over its wall's stiffness."""
    record = read_objects()[name]
    spec, ranges = record.spec, record.range
    (light, heavy), (slick, rough) = ranges["mass_kg"], ranges["friction"]
    soft, stiff = ranges["stiffness_n_m"]
    loads = zip(np.geomspace(light, heavy, N_LOADS), np.geomspace(rough, slick, N_LOADS), strict=True)
    return [
        spec,
        *(spec.with_(mass_kg=round(float(mass), 4), friction=round(float(mu), 4)) for mass, mu in loads),
        *(spec.with_(stiffness_n_m=round(float(wall), 1)) for wall in np.geomspace(soft, stiff, N_WALLS)),
    ]


@click.group(help=__doc__)
def main() -> None:
    """Group of the commands."""


@main.command("run")
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
def run(file: Path) -> None:
    """Run the lifts of every object, and write FILE."""
    found = [
        [try_level(spec, level) for level in LEVELS] for name in read_objects() for spec in variants(name)
    ]
    file.write_bytes(b"[\n" + b",\n".join(msgspec.json.encode(rows) for rows in found) + b"\n]\n")


@main.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
def table(file: Path) -> None:
    """Print FILE as Markdown: each object as it is, then what counts over its ranges."""
    click.echo(table_text(_read(file)))


@main.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.argument("png", type=click.Path(dir_okay=False, path_type=Path))
def picture(file: Path, png: Path) -> None:
    """Draw FILE: level against load and against stiffness, a row an object."""
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
    figure.suptitle(
        "What each level does to each object, by script (simulated)", x=0.02, ha="left", fontsize=10
    )
    figure.savefig(png, dpi=110)


def table_text(found: list[list[LevelOutcome]]) -> str:
    """Return the map as Markdown: levels of each object as it is, and what counts in every variant."""
    lines = [
        "| object | level | | slid mm | fastest mm/s | seen after ms: direct, aside | slid by then mm | narrower mm |",
        "|---|---|---|---|---|---|---|---|",
    ]
    names = list(dict.fromkeys(rows[0].object for rows in found))
    for name in names:
        for one in next(rows for rows in found if rows[0].object == name):
            seen, slid = (_by_view(of) for of in (one.seen_ms, one.slid_unseen_mm))
            lines.append(
                f"| {name} | {one.level} | {_said(one)} | {one.slid_mm:.1f} | {one.fastest_mm_s:.0f} | {seen} | {slid} "
                f"| {one.narrowed_mm:.1f} |"
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
        cells = [_said(r) for r in rows]
        verdicts = ["yes" if counts(rows, what) else "no" for what in FAILURES]
        lines.append(
            f"| {one.object} | {one.mass_kg:.2f} | {one.friction:.2f} | {one.stiffness_n_m / 1e3:.2f} | "
            f"{' | '.join([*cells, *verdicts])} |"
        )
    return "\n".join(lines)


def _grip(one: LiftResult) -> Grip:
    if not one.held:
        return "lost"
    return "slips" if one.slips else "holds"


def _seen(up: Sequence[WorldTruth], view: ViewName) -> tuple[float, float] | None:
    """Return when, after the first slide began, eyes have seen it, ms, and how far it had slid since, mm."""
    onset = next((k for k, truth in enumerate(up) if truth.slip_m_s >= SLIP_M_S), None)
    if onset is None:
        return None
    first = last = up[onset]
    chance = np.random.default_rng(0)
    # Who looks, looks all the time.
    sight = msgspec.structs.replace(typical_person().vision, gaze_grasp=1.0)
    eyes = Eyes(sight, width_m=1.0, gaze=chance, looks=chance, poses=chance, reaction=chance, view=view)
    for truth in up[onset:]:
        found = eyes.see(truth.t_s, truth.t_s - last.t_s, truth, carried=False, lifting=False, held=True)
        if any(event.kind == "slip" for event in found):
            return 1e3 * (truth.t_s - first.t_s), 1e3 * (truth.slip_m - first.slip_m)
        last = truth
    return None


def _said(one: LevelOutcome) -> str:
    return f"{one.grip}{', harmed' if one.harmed else ''}"


def _by_view(numbers: dict[ViewName, float]) -> str:
    looking: tuple[ViewName, ...] = ("direct", "aside")
    return ", ".join(f"{numbers[view]:.0f}" if view in numbers else "–" for view in looking)


def _read(file: Path) -> list[list[LevelOutcome]]:
    return msgspec.json.decode(read_foreign(file, most_mib=4), type=list[list[LevelOutcome]])


if __name__ == "__main__":
    main()
