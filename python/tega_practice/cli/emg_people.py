"""Compare decoders on simulated people at the Fitts test: ``tega-teleop emg people``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tega.ui.cli.options import NameList, echo_json, json_option

if TYPE_CHECKING:
    from tega_practice.interval import Interval
    from tega_practice.people import PeopleSkill

__all__ = ["emg_people"]


@click.command(
    epilog="Example: tega-teleop emg people --people 2 --decoders rules,proportional --effects none,sweat"
)
@click.option(
    "--people",
    "n_people",
    type=click.IntRange(1, 10_000),
    default=100,
    show_default=True,
    help="Number of simulated people.",
)
@click.option(
    "--seed", type=click.IntRange(0), default=0, show_default=True, help="Seed of the first person."
)
@click.option(
    "--decoders",
    type=NameList(),
    default="rules,proportional,learned",
    show_default=True,
    help="Decoders; the others are compared with the first. rules-paper, learned-huber and installed ones go, too.",
)
@click.option(
    "--effects",
    type=NameList(),
    default="none,shift,sweat,cocontraction,posture,all",
    show_default=True,
    help="Effects that set in after calibration and practice.",
)
@click.option(
    "--movements",
    type=click.IntRange(1, 100),
    default=3,
    show_default=True,
    help="Movements for each distance and width.",
)
@click.option("--jobs", type=click.IntRange(0), default=0, help="Worker processes; 0: as many as cores.")
@click.option(
    "--out",
    type=click.Path(path_type=Path, dir_okay=False),
    help="Keep people in this file, and go on from it.",
)
@json_option
def emg_people(
    *,
    n_people: int,
    seed: int,
    decoders: list[str],
    effects: list[str],
    movements: int,
    jobs: int,
    out: Path | None,
    as_json: bool,
) -> None:
    """Compare decoders on simulated people at the Fitts test. Everything in it is simulated.

    Each person is calibrated and practises with each decoder, then does the test under each effect (electrode shift,
    sweat, co-contraction, posture), which calibration and practice did not have. Intervals are 95 %, over people.

    \b
    --json prints {"simulated": true, "people", "parameters", "rows": [an object an effect and decoder: decoder,
      effect, people, refused, throughput_bits_s, completion, path_efficiency, overshoots,
      difference_bits_s (to the first decoder), lost_bits_s (to no effect), each {mean, low, high, n}]}
    """  # noqa: D301  # click keeps the lines after \b as they are
    import os

    import msgspec

    from tega.ui.cli.options import progress_bar
    from tega_practice.people import compare_people, people_at_test

    with progress_bar() as progress:
        people = people_at_test(
            range(seed, seed + n_people),
            decoders,
            effects,
            movements=movements,
            workers=jobs or os.cpu_count() or 1,
            out=out,
            progress=progress,
        )
    rows = compare_people(people, decoders, effects)
    if as_json:
        told: dict[str, Any] = {"simulated": True, "people": n_people, "parameters": people[0].parameters}
        echo_json(told | {"rows": msgspec.to_builtins(rows)})
    else:
        _print(rows, n_people)


def _print(rows: list[PeopleSkill], n_people: int) -> None:
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.table import Table

    shown = Table(
        box=SIMPLE, title=f"Fitts test, {n_people} simulated people; [95 % interval]", title_justify="left"
    )
    for name in ("effect", "decoder"):
        shown.add_column(name, no_wrap=True)
    for name in ("bits/s", "against first", "lost", "hit %", "path %", "overshoots"):
        shown.add_column(name, justify="right", no_wrap=True)
    for row in rows:
        shown.add_row(
            row.effect,
            row.decoder + (f" ({row.refused} refused)" if row.refused else ""),
            interval_told(row.throughput_bits_s),
            interval_told(row.difference_bits_s),
            interval_told(row.lost_bits_s),
            f"{100 * row.completion.mean:.0f}",
            "–" if row.path_efficiency is None else f"{100 * row.path_efficiency.mean:.0f}",
            f"{row.overshoots.mean:.1f}",
        )
    Console(highlight=False, width=118).print(shown)


def interval_told(interval: Interval | None) -> str:
    """Return a mean and its interval in words."""
    if interval is None:
        return "–"
    if interval.low is None or interval.high is None:
        return f"{interval.mean:.2f}"
    return f"{interval.mean:.2f} \\[{interval.low:.2f}, {interval.high:.2f}]"
