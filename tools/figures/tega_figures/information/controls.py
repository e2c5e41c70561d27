"""Fix the design of the bench's positive controls, run it, and print and draw what came out.

``python -m tega_figures.information.controls run FILE`` goes on where it was stopped; ``table FILE`` and
``picture FILE PNG`` show what it holds.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

import click
import msgspec

from tega.runtime.files.foreign_file import read_foreign
from tega_figures.information.bench import OFF
from tega_figures.information.compare import paired, power_text
from tega_figures.information.sessions import (
    MARGIN,
    OUTCOMES,
    BenchSession,
    bench_session,
    pairs,
    verdict,
)
from tega_sim.conditions import Condition
from tega_sim.operator import VIEWS, RulesVersion, ViewName
from tega_sim.seams import Shear
from tega_sim.world import ObjectSpec, read_objects

SOFTEST: Final[dict[str, ObjectSpec]] = {
    record.spec.name: record.spec.with_(
        name=f"soft-{record.spec.name}", stiffness_n_m=record.range["stiffness_n_m"][0]
    )
    for record in read_objects().values()
}
"""Each object with the softest wall of its range: where both slips and harm can happen, by the feasibility map."""

CELLS: Final[tuple[tuple[ViewName, Condition], ...]] = (
    ("hidden", "non-haptic"),
    ("hidden", "oracle"),
    ("hidden", "mistimed"),
    ("hidden", "true-force"),
    ("hidden", "ideal-vest"),
    ("direct", "non-haptic"),
    ("direct", "oracle"),
    ("hidden", "haptic"),
    ("hidden", "replayed"),
    ("hidden", "constant"),
    ("hidden", "unrelated"),
    ("hidden", "true-reflex"),
    ("hidden", "reflex"),
    ("hidden", "haptic-reflex"),
)
"""View and condition of each session of a person, in the order in which they are run."""

CONTROLS: Final[tuple[Condition, ...]] = ("oracle", "true-force", "ideal-vest")
"""Any of these may say yes on any object: as many tests, so that their intervals are wider (Bonferroni)."""

N_LIFTS: Final = 3
FIRST_SEED: Final = 4000
N_PEOPLE: Final = 12


@click.group(help=__doc__)
def main() -> None:
    """Group of the commands."""


@main.command()
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@click.option("--people", default=N_PEOPLE, show_default=True)
@click.option("--first", default=FIRST_SEED, show_default=True, help="Seed of the first person.")
@click.option("--only", multiple=True, help="Only the cells of these conditions.")
@click.option("--view", type=click.Choice(list(VIEWS)), help="Only the cells of this view.")
@click.option(
    "--rules", type=click.IntRange(2, 3), default=2, show_default=True, help="Version of the rules."
)
@click.option(
    "--shear",
    type=click.Choice(["off", "texture", "dots"]),
    default="off",
    show_default=True,
    help="Of the gels; the metric is shear then, which the reflex goes by.",
)
@click.option("--object", "names", multiple=True, type=click.Choice(list(SOFTEST)), help="Instead of all.")
def run(
    file: Path,
    *,
    people: int,
    first: int,
    only: tuple[str, ...],
    view: ViewName | None,
    rules: RulesVersion,
    shear: Shear,
    names: tuple[str, ...],
) -> None:
    """Run the sessions that FILE does not hold yet, person by person, and add each as it ends."""
    known = (
        {(one.seed, one.object, one.view, one.condition) for one in read(file)} if file.exists() else set()
    )
    specs = [SOFTEST[name] for name in names or SOFTEST]
    settings = () if shear == "off" else ("stages.metric.name=shear",)
    with file.open("ab") as out:
        for seed in range(first, first + people):
            for seen, condition in CELLS:
                if (only and condition not in only) or view not in {None, seen}:
                    continue
                for spec in specs:
                    if (seed, spec.name, seen, condition) in known:
                        continue
                    one = bench_session(
                        seed,
                        spec,
                        view=seen,
                        condition=condition,
                        n_lifts=N_LIFTS,
                        rules=rules,
                        shear=shear,
                        settings=settings,
                    )
                    out.write(msgspec.json.encode(one) + b"\n")
                    out.flush()


@main.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
def table(file: Path) -> None:
    """Print FILE as Markdown."""
    click.echo(table_text(read(file)))


@main.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.option("--tests", default=1, show_default=True, help="So many were planned (Bonferroni).")
def power(file: Path, *, tests: int) -> None:
    """Print what FILE could have seen, and how many people its differences ask for."""
    sessions = read(file)
    rows = {
        f"{name}, {view}, `{condition}`": pairs(sessions, view=view, condition=condition, name=name)
        for name in dict.fromkeys(one.object for one in sessions)
        for view, condition in cells_of(sessions)
        if condition != OFF
    }
    rows = {arm: both for arm, both in rows.items() if len(both[0]) > 1}
    click.echo(power_text(rows, OUTCOMES, confidence=1 - 0.05 / tests))


@main.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.argument("png", type=click.Path(dir_okay=False, path_type=Path))
def picture(file: Path, png: Path) -> None:
    """Draw the way slid and the share of lifts lost under each arm of FILE, less those without a vest, into PNG."""
    from matplotlib.figure import Figure

    sessions = read(file)
    names = list(dict.fromkeys(one.object for one in sessions))
    shown = [
        (name, view, condition)
        for name in names
        for view, condition in cells_of(sessions)
        if condition != OFF and len(pairs(sessions, view=view, condition=condition, name=name)[0])
    ]
    figure = Figure(figsize=(9, 0.34 * len(shown) + 1.4), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for place, (name, view, condition) in enumerate(reversed(shown)):
        found = paired(*pairs(sessions, view=view, condition=condition, name=name), names=OUTCOMES)
        colour = "#1f5fbf" if condition in CONTROLS else "#777777"
        for axes, what in ((left, "slid"), (right, "harm")):
            axes.plot([found[what].low, found[what].high], [place, place], color=colour, lw=2)
            axes.plot([found[what].mean], [place], "o", color=colour)
    for axes, label in ((left, "way slid a lift, mm"), (right, "share of lifts with deformation")):
        axes.axvline(0, color="0.6", lw=0.8)
        axes.set_xlabel(label)
    left.set_yticks(range(len(shown)), [f"{name}, {view}: {arm}" for name, view, arm in reversed(shown)])
    figure.suptitle(
        "Less than without a vest; mean and 95 % interval over people (simulated)",
        x=0.02,
        ha="left",
        fontsize=10,
    )
    figure.savefig(png, dpi=110)


def read(file: Path) -> list[BenchSession]:
    """Read sessions, one a line."""
    return [
        msgspec.json.decode(line, type=BenchSession) for line in read_foreign(file, most_mib=64).splitlines()
    ]


def cells_of(sessions: list[BenchSession]) -> list[tuple[ViewName, Condition]]:
    """Return the design's cells that sessions are of, in its order."""
    there = {(one.view, one.condition) for one in sessions}
    return [cell for cell in CELLS if cell in there]


def table_text(sessions: list[BenchSession]) -> str:
    """Return outcomes without a vest, and every arm's differences from them within people, as Markdown."""
    lines = [
        f"| object | view | condition | people | {' | '.join(OUTCOMES)} | says |",
        "|---" * (len(OUTCOMES) + 5) + "|",
    ]
    names = list(dict.fromkeys(one.object for one in sessions))
    for name in names:
        for view, condition in sorted(cells_of(sessions), key=lambda cell: (cell[0], cell[1] != OFF)):
            told, off = pairs(sessions, view=view, condition=condition, name=name)
            if not len(told):
                continue
            if condition == OFF:
                cells, said = [f"{mean:.2f}" for mean in off.mean(axis=0)], ""
            else:
                tests = len(CONTROLS) * len(names) if condition in CONTROLS else 1
                found = paired(told, off, names=OUTCOMES, confidence=1 - 0.05 / tests)
                cells = [f"{d.mean:+.2f} ({d.low:+.2f} to {d.high:+.2f})" for d in found.values()]
                said = verdict(found)
            lines.append(f"| {name} | {view} | `{condition}` | {len(told)} | {' | '.join(cells)} | {said} |")
    lines += ["", f"Margins: {', '.join(f'{what} {margin:g}' for what, margin in MARGIN.items())}."]
    return "\n".join(lines)


if __name__ == "__main__":
    main()
