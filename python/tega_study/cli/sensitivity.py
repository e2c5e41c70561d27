"""Vary the simulated study's assumptions: ``tega-teleop study sensitivity``."""

from __future__ import annotations

from pathlib import Path

import click

from tega.ui.cli.options import NameList, echo_json, json_option
from tega_study.cli.simulate import SHARD, trials_displayed


@click.command(epilog="Example: tega-teleop study sensitivity in-silico")
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False))
@click.option(
    "--operators",
    type=click.IntRange(2, 999),
    default=4,
    show_default=True,
    help="Simulated people in each small study.",
)
@click.option(
    "--trials",
    type=click.IntRange(1, 1000),
    default=2,
    show_default=True,
    help="Trials of each object under each condition.",
)
@click.option(
    "--vary",
    type=NameList(),
    metavar="NAMES",
    help="Parameters such as vest.weber,motor.aim_sd; a set unless given.",
)
@click.option("--jobs", type=click.IntRange(0, 1024), default=0, help="Worker processes; 0 for all cores.")
@click.option("--shard", type=SHARD, default="1/1", help="Only the i-th of n parts, for many machines.")
@click.option("--dask", metavar="ADDRESS", default="", help="Use the workers of a dask scheduler.")
@json_option
def sensitivity(
    *,
    folder: Path,
    operators: int,
    trials: int,
    vary: list[str] | None,
    jobs: int,
    shard: tuple[int, int],
    dask: str,
    as_json: bool,
) -> None:
    """Vary the simulated study's assumptions and print where the paper's directions hold.

    FOLDER is a study in silico. One assumption at a time is changed: a parameter to either end of its range, the vest
    to a sham, the readings to those printed; each change is a small study in FOLDER/sensitivity. The table goes into
    FOLDER's report. Run it again to go on where it was stopped.
    """
    from tega_study.cli.apart import report_apart
    from tega_study.plan import read_plan
    from tega_study.silico import unfinished
    from tega_study.silico.sensitivity import VARIED, run_sensitivity

    with trials_displayed() as progress:
        left = run_sensitivity(
            folder,
            operators=operators,
            trials=trials,
            varied=vary or VARIED,
            jobs=jobs,
            shard=shard,
            dask=dask,
            progress=progress,
        )
    page = None if unfinished(folder, read_plan(folder)) else report_apart(folder)
    if as_json:
        echo_json({"out": str(folder), "left": left, "report": page and str(page)})
        return
    if left:
        click.echo(f"{folder}: {len(left)} changes are left to other shards")
    click.echo(
        f"{page}" if page else f"{folder}: the study itself is not done; its report will have the table"
    )
