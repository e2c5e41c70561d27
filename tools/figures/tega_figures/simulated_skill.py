"""Print and draw decoders compared on simulated people: the table and the picture of docs/evidence/emg-decoders.md.

``python -m tega_figures.simulated_skill people.jsonl docs/images/emg-skill.png`` simulates the people who are not in
people.jsonl yet and adds them. Everything in it is simulated.
"""

from __future__ import annotations

import os
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click
import numpy as np

from tega.errors import MissingExtraError, TegaError
from tega.ui.cli.options import NameList, progress_bar
from tega_figures.skill_people import compare_people, people_at_test

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tega_figures.skill_people import PeopleSkill

__all__ = ["main", "skill_figure", "skill_table"]

SHOWN: Final = {"none": "no effect", "all": "all effects together"}
"""What an effect is called in the picture, where not by its own name."""


@click.command(help=__doc__)
@click.argument("people", type=click.Path(path_type=Path, dir_okay=False))
@click.argument("picture", type=click.Path(path_type=Path, dir_okay=False), required=False)
@click.option("--people", "n_people", type=click.IntRange(1, 10_000), default=100, show_default=True)
@click.option("--decoders", type=NameList(), default="rules,proportional,learned", show_default=True)
@click.option("--effects", type=NameList(), default="none,all", show_default=True)
@click.option("--movements", type=click.IntRange(1, 100), default=3, show_default=True)
def main(
    *,
    people: Path,
    picture: Path | None,
    n_people: int,
    decoders: list[str],
    effects: list[str],
    movements: int,
) -> None:
    """Print the table, and draw the picture where one is named."""
    with progress_bar() as progress:
        known = people_at_test(
            range(n_people),
            decoders,
            effects,
            movements=movements,
            workers=os.cpu_count() or 1,
            out=people,
            progress=progress,
        )
    rows = compare_people(known, decoders, effects)
    click.echo(f"{len(known)} simulated people, {movements} movements of each distance and width.\n")
    click.echo(skill_table(rows))
    if picture is not None:
        skill_figure(rows, len(known)).savefig(picture, dpi=110)


def skill_table(rows: list[PeopleSkill]) -> str:
    """Return the comparison as Markdown."""
    lines = [
        "| effect | decoder | throughput, bits/s | against the first | lost to the effect | hit | path | overshoots |",
        "|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        refused = f" (refused on {row.refused})" if row.refused else ""
        told = (row.throughput_bits_s, row.difference_bits_s, row.lost_bits_s)
        intervals = " | ".join("–" if one is None else str(one) for one in told)
        path = "–" if row.path_efficiency is None else f"{100 * row.path_efficiency.mean:.0f} %"
        lines.append(
            f"| {row.effect} | `{row.decoder}`{refused} | {intervals} | {100 * row.completion.mean:.0f} % | {path} | "
            f"{row.overshoots.mean:.1f} |"
        )
    return "\n".join(lines)


def skill_figure(rows: list[PeopleSkill], n_people: int) -> Figure:
    """Draw throughput and hits with their intervals, a group an effect."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("the picture needs matplotlib", "pip install 'tega[pictures]'") from error
    effects = list(dict.fromkeys(row.effect for row in rows))
    decoders = list(dict.fromkeys(row.decoder for row in rows))
    figure = Figure(figsize=(8, 5.5), layout="constrained")
    above, below = figure.subplots(2, 1, sharex=True)
    for n, decoder in enumerate(decoders):
        mine = {row.effect: row for row in rows if row.decoder == decoder}
        x = np.arange(len(effects)) + (n - (len(decoders) - 1) / 2) * 0.22
        for axes, name, times in ((above, "throughput_bits_s", 1), (below, "completion", 100)):
            told = [getattr(mine[effect], name) for effect in effects]
            means = np.array([times * one.mean for one in told])
            lows = np.array([times * (one.mean if one.low is None else one.low) for one in told])
            axes.errorbar(x, means, yerr=means - lows, fmt="o", capsize=3, label=decoder)
    above.set(ylabel="throughput, bits/s", ylim=(0, None))
    below.set(ylabel="movements that hit, %", ylim=(0, 105))
    below.set_xticks(np.arange(len(effects)), [SHOWN.get(effect, effect) for effect in effects])
    below.set_xlabel("effect on the EMG since practice")
    above.legend(title="decoder")
    above.set_title(f"Fitts test of {n_people} simulated people, mean and 95 % interval over people")
    return figure


if __name__ == "__main__":
    try:
        main()
    except TegaError as error:
        raise SystemExit(f"error: {error}") from None
