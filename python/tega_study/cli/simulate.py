"""Run a whole study with simulated people, and vary its assumptions: ``study simulate`` and ``sensitivity``."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from tega.ui.cli.options import NAMES, answer, json_option, progress_bar
from tega_sim.cli.options import chosen_objects, loop_options, loop_sets, object_options
from tega_study.cli.options import (
    FOLDER,
    design_options,
    folder_argument,
    shown_option,
    trials_option,
    workers_options,
)

LINE_EVERY_S = 30.0


@contextmanager
def trials_displayed() -> Iterator[Callable[[str, int, int], None]]:
    """Show how many trials are done: a bar on a terminal, else a line now and then, for the log of a cluster's job."""
    if sys.stderr.isatty():
        with progress_bar() as bar:
            yield bar
        return
    begun_s, reported_s, at_first = time.monotonic(), 0.0, -1

    def notify(subject: str, done: int, total: int) -> None:
        nonlocal reported_s, at_first
        at_first = done if at_first < 0 else at_first
        now_s = time.monotonic()
        if done < total and now_s - reported_s < LINE_EVERY_S:
            return
        reported_s = now_s
        left_s = (total - done) * (now_s - begun_s) / (done - at_first) if done > at_first else 0.0
        click.echo(
            f"{done} of {total} {subject}" + (f", {left_s / 60:.0f} min left" if left_s else ""), err=True
        )

    yield notify


def report_apart(folder: Path) -> Path:
    """Write a study's report in another process, and return its page.

    The memory of sessions and that of statistics do not add up then. That process prints its errors on this one's
    standard error; if it fails, this one exits with its exit code.
    """
    from tega.runtime.child_process import python_command, python_environment

    command = python_command("tega.ui.cli", "study", "report", str(folder))
    quiet = subprocess.DEVNULL
    done = subprocess.run(command, env=python_environment(), stdin=quiet, stdout=quiet, check=False)
    if done.returncode < 0:
        signal = f"error: {folder}: the process that wrote its report was ended by signal {-done.returncode}"
        click.echo(f"{signal}\nhint: tega-teleop study report writes it again", err=True)
    if done.returncode:
        sys.exit(max(done.returncode, 1))
    return folder / "report.html"


@click.command(epilog="Example: tega-teleop study simulate --operators 10 --out in-silico")
@click.option("--operators", type=click.IntRange(1, 999), required=True, help="How many simulated people.")
@click.option(
    "--out", type=FOLDER, required=True, help="New folder, or the folder of the same study to go on with it."
)
@design_options(seed="Seed of the people and of all chance.")
@workers_options
@click.option(
    "--parameters",
    type=click.Path(path_type=Path, dir_okay=False, exists=True),
    metavar="FILE.toml",
    help="Another parameter file for the simulated people; the report then calls it changed.",
)
@object_options
@loop_options
@json_option
def simulate(
    *,
    operators: int,
    out: Path,
    objects: list[str],
    objects_file: Path | None,
    mass_kg: list[float] | None,
    stiffness_n_m: list[float] | None,
    friction: list[float] | None,
    config: Path | None,
    sets: tuple[str, ...],
    as_json: bool,
    **requested: Any,
) -> None:
    """Run the whole study with simulated people, and report it once all sessions are there.

    Each person goes through a whole session in the plan's order, with learning and fatigue from trial to trial. The
    results are the same with any number of workers, shards and machines. Run it again to continue after a stop; an
    interrupted session is restarted. The report names the parameter file that the people were drawn from.

    On the shipped objects it is a rehearsal of the protocol: no control with the truth finds a difference there, so
    that equal arms say nothing.
    """
    from tega_sim.world import crossed
    from tega_study.silico.simulate import simulate as run
    from tega_study.silico.simulate import unfinished

    specs = crossed(
        list(chosen_objects(objects, objects_file).values()),
        mass_kg=mass_kg or (),
        stiffness_n_m=stiffness_n_m or (),
        friction=friction or (),
    )
    with trials_displayed() as progress:
        plan = run(
            out,
            operators=operators,
            objects=specs,
            settings=loop_sets(config, sets),
            progress=progress,
            **requested,
        )
    left = unfinished(out, plan)
    page = None if left else report_apart(out)
    line = f"{page}: simulated, {operators} people, {len(plan.trials)} trials"
    if left:
        line = f"{out}: {len(left)} of {operators} sessions are left to other shards"
    value = {"out": str(out), "operators": operators, "left": left, "report": page and str(page)}
    answer(value, [line], as_json=as_json)


@click.command(epilog="Example: tega-teleop study sensitivity in-silico")
@folder_argument
@shown_option(
    "--operators", type=click.IntRange(2, 999), default=4, help="Simulated people in each small study."
)
@trials_option(2)
@click.option(
    "--vary",
    type=NAMES,
    metavar="NAMES",
    help="Parameters such as vest.weber,motor.aim_sd; a set unless given.",
)
@workers_options
@json_option
def sensitivity(*, folder: Path, vary: list[str] | None, as_json: bool, **requested: Any) -> None:
    """Vary the simulated study's assumptions and print where the paper's directions hold.

    FOLDER is a study in silico. One assumption at a time is changed: a parameter to either end of its range, the vest
    to a sham, the readings to those printed; each change is a small study in FOLDER/sensitivity. The table goes into
    FOLDER's report. Run it again to go on where it was stopped.
    """
    from tega_study.plan import read_plan
    from tega_study.silico.sensitivity import VARIED, run_sensitivity
    from tega_study.silico.simulate import unfinished

    with trials_displayed() as progress:
        left = run_sensitivity(folder, varied=vary or VARIED, progress=progress, **requested)
    page = None if unfinished(folder, read_plan(folder)) else report_apart(folder)
    lines = [f"{folder}: {len(left)} changes are left to other shards"] if left else []
    lines.append(
        str(page) if page else f"{folder}: the study itself is not done; its report will have the table"
    )
    answer({"out": str(folder), "left": left, "report": page and str(page)}, lines, as_json=as_json)
