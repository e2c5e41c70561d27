"""Run a whole study with simulated people: ``tega-teleop study simulate``."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import click

from tega.ui.cli.options import NameList, echo_json, json_option
from tega_sim.cli.options import chosen_objects, loop_options, loop_sets, object_options

if TYPE_CHECKING:
    from tega_sim.operator import ViewName

LINE_EVERY_S = 30.0

_FOLDER = click.Path(path_type=Path, file_okay=False)


@contextmanager
def trials_displayed() -> Iterator[Callable[[str, int, int], None]]:
    """Show how many trials are done: a bar on a terminal, else a line now and then, for the log of a cluster's job."""
    from tega.ui.cli.options import progress_bar

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


class _Shard(click.ParamType[tuple[int, int]]):
    """Part of a simulation that is shared between machines, such as 2/8."""

    name = "i/n"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> tuple[int, int]:
        """Read the part, or fail with a usage error."""
        if isinstance(value, tuple):
            return value
        part, _, parts = str(value).partition("/")
        if not (part.isdecimal() and parts.isdecimal() and 1 <= int(part) <= int(parts)):
            self.fail(f"{value!r} is not i/n with i from 1 to n, such as 2/4", param, ctx)
        return int(part), int(parts)


SHARD = _Shard()


@click.command(epilog="Example: tega-teleop study simulate --operators 10 --out in-silico")
@click.option("--operators", type=click.IntRange(1, 999), required=True, help="How many simulated people.")
@click.option(
    "--out", type=_FOLDER, required=True, help="New folder, or the folder of the same study to go on with it."
)
@click.option(
    "--seed",
    type=click.IntRange(0, 2**31),
    default=1,
    show_default=True,
    help="Seed of the people and of all chance.",
)
@click.option(
    "--objects",
    type=NameList(),
    default="bottle,container,bag",
    show_default=True,
    help="Objects that are lifted.",
)
@click.option(
    "--conditions",
    type=NameList(),
    default="haptic,non-haptic",
    show_default=True,
    help="Conditions: the first is compared with the second.",
)
@click.option(
    "--trials",
    type=click.IntRange(1, 1000),
    default=10,
    show_default=True,
    help="Trials of each object under each condition.",
)
@click.option("--jobs", type=click.IntRange(0, 1024), default=0, help="Worker processes; 0 for all cores.")
@click.option("--shard", type=SHARD, default="1/1", help="Only the i-th of n parts, for many machines.")
@click.option(
    "--dask",
    metavar="ADDRESS",
    default="",
    help="Use the workers of a dask scheduler, such as tcp://host:8786.",
)
@click.option(
    "--parameters", type=click.Path(path_type=Path, dir_okay=False, exists=True), metavar="FILE.toml",
    help="Another parameter file for the simulated people; the report then calls it changed.",
)  # fmt: skip
@click.option(
    "--rules", type=click.IntRange(1, 3), default=3, show_default=True,
    help="Version of the rules that the people follow; with 2 and 3 they practise first.",
)  # fmt: skip
@click.option(
    "--fresh", is_flag=True,
    help="Each condition is met as if there were no other, with the same chance under each; only simulated people can.",
)  # fmt: skip
@object_options
@loop_options
@json_option
def simulate(
    *,
    operators: int,
    out: Path,
    seed: int,
    objects: list[str],
    conditions: list[str],
    trials: int,
    jobs: int,
    shard: tuple[int, int],
    dask: str,
    parameters: Path | None,
    rules: Literal[1, 2, 3],
    fresh: bool,
    view: ViewName,
    objects_file: Path | None,
    mass_kg: list[float] | None,
    stiffness_n_m: list[float] | None,
    friction: list[float] | None,
    preset: Literal["paper", "live"],
    config: Path | None,
    sets: tuple[str, ...],
    as_json: bool,
) -> None:
    """Run the whole study with simulated people, and report it once all sessions are there.

    Each person goes through a whole session in the plan's order, with learning and fatigue from trial to trial. The
    results are the same with any number of workers, shards and machines. Run it again to continue after a stop; an
    interrupted session is restarted. The report names the parameter file that the people were drawn from.
    """
    from tega_sim.world import crossed
    from tega_study.cli.apart import report_apart
    from tega_study.silico import simulate as run
    from tega_study.silico import unfinished

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
            seed=seed,
            objects=specs,
            conditions=conditions,
            trials=trials,
            jobs=jobs,
            shard=shard,
            dask=dask,
            parameters=parameters,
            preset=preset,
            settings=loop_sets(config, sets),
            rules=rules,
            view=view,
            fresh=fresh,
            progress=progress,
        )
    left = unfinished(out, plan)
    page = None if left else report_apart(out)
    if as_json:
        echo_json({"out": str(out), "operators": operators, "left": left, "report": page and str(page)})
    elif left:
        click.echo(f"{out}: {len(left)} of {operators} sessions are left to other shards")
    else:
        click.echo(f"{page}: simulated, {operators} people, {len(plan.trials)} trials")
