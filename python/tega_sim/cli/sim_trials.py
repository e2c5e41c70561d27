"""Run many simulated trials over all cores: ``tega-teleop sim trials``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tega.ui.cli.options import FILE, NAMES, echo_json, json_option, progress_bar
from tega_sim.cli.options import (
    chosen_objects,
    loop_options,
    loop_sets,
    object_options,
    objects_option,
    print_rows,
)
from tega_sim.conditions import CONDITIONS

if TYPE_CHECKING:
    from tega_sim.trial import TrialResult
    from tega_sim.trials import Row


@click.group(epilog="Example: tega-teleop sim trials --seeds 10 --out trials.jsonl")
def sim() -> None:
    """Simulate trials without a study's folder."""


@sim.command(epilog="Example: tega-teleop sim trials --seeds 10 --out trials.jsonl")
@objects_option
@click.option(
    "--conditions",
    type=NAMES,
    default="haptic,non-haptic",
    show_default=True,
    help=f"Conditions to compare: any of {', '.join(CONDITIONS)}.",
)
@click.option(
    "--seeds",
    "n_seeds",
    type=click.IntRange(1, 100_000),
    default=10,
    show_default=True,
    help="How many persons.",
)
@click.option(
    "--first-seed", type=click.IntRange(0, 2**31), default=1, show_default=True, help="The first one."
)
@click.option(
    "--operator",
    type=click.Choice(["simulated", "scripted"]),
    default="simulated",
    show_default=True,
    help="Who leads the hand: the simulated person, or a fixed script.",
)
@click.option(
    "--practice", type=click.IntRange(0, 100), default=0, show_default=True, help="Lifts before each trial."
)
@click.option(
    "--task",
    type=click.Choice(["lift", "place", "fill"]),
    default="lift",
    show_default=True,
    help="lift: put down where it stood. place: carried to a second marked place first. fill: held for ten seconds "
    "while it grows heavier.",
)
@object_options
@loop_options
@click.option(
    "--jobs",
    type=click.IntRange(0, 1024),
    default=0,
    help="Worker processes; 0 for as many as there are cores.",
)
@click.option("--out", type=FILE, help="Keep results in this file, and go on from it.")
@json_option
def trials(
    *,
    objects: list[str],
    conditions: list[str],
    n_seeds: int,
    first_seed: int,
    objects_file: Path | None,
    mass_kg: list[float] | None,
    stiffness_n_m: list[float] | None,
    friction: list[float] | None,
    config: Path | None,
    sets: tuple[str, ...],
    jobs: int,
    out: Path | None,
    as_json: bool,
    **same: Any,
) -> None:
    """Run every object under every condition with every seed, and compare. Everything in it is simulated.

    A seed is a person: trials that differ only in object or condition have the same person and the same chance. The
    results are the same with any number of workers. With --out they are kept, one JSON object a line, and trials
    that the file holds already are not run again.

    \b
    --json prints one object:
      trials   as in the file: [{object, condition, seed, success, slips, deformations, drops, duration_s,
               peak_force_n, ...}]
      table    [{object, condition, n, success, slips, deformations, drops, duration_s, peak_force_n}], means
      wall_s, simulated_s, jobs
    """  # noqa: D301  # click keeps the lines after \b as they are
    import os
    import time

    import msgspec

    from tega_sim.trials import plan_trials, run_trials, summarise_trials

    plans = plan_trials(
        objects if objects_file is None else chosen_objects(objects, objects_file),
        conditions,
        range(first_seed, first_seed + n_seeds),
        mass_kg=mass_kg or (None,),
        stiffness_n_m=stiffness_n_m or (None,),
        friction=friction or (None,),
        settings=loop_sets(config, sets),
        **same,
    )
    jobs = jobs or os.cpu_count() or 1
    started = time.perf_counter()
    with progress_bar() as progress:
        results = run_trials(plans, jobs=jobs, out=out, progress=progress)
    wall_s = time.perf_counter() - started
    table = summarise_trials(results)
    if as_json:
        simulated_s = sum(result.simulated_s for result in results)
        measured = {"wall_s": wall_s, "simulated_s": simulated_s, "jobs": jobs}
        echo_json({"trials": msgspec.to_builtins(results), "table": msgspec.to_builtins(table), **measured})
    else:
        _print(results, table, wall_s=wall_s, jobs=jobs)


def _print(results: list[TrialResult], table: list[Row], *, wall_s: float, jobs: int) -> None:
    out = print_rows(
        "simulated trials, means",
        table,
        {
            "object": lambda row: row.object,
            "condition": lambda row: row.condition,
            "trials": lambda row: str(row.n),
            "lifted": lambda row: f"{row.success:.0%}",
            "slips": lambda row: f"{row.slips:.2f}",
            "deformations": lambda row: f"{row.deformations:.2f}",
            "drops": lambda row: f"{row.drops:.2f}",
            "time s": lambda row: f"{row.duration_s:.1f}",
            "peak N": lambda row: f"{row.peak_force_n:.1f}",
        },
    )
    out.print(
        f"trials: {len(results)}; simulated persons: {len({r.seed for r in results})}; took {wall_s:.1f} s "
        f"({jobs} workers)"
    )
