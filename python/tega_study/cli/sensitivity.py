"""Vary the simulated study's assumptions: ``tega-teleop study sensitivity``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from tega.ui.cli.options import NameList, echo_json, json_option
from tega_study.cli.options import folder_argument, shown_option, trials_option, workers_options
from tega_study.cli.simulate import trials_displayed


@click.command(epilog="Example: tega-teleop study sensitivity in-silico")
@folder_argument
@shown_option(
    "--operators", type=click.IntRange(2, 999), default=4, help="Simulated people in each small study."
)
@trials_option(2)
@click.option(
    "--vary",
    type=NameList(),
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
    from tega_study.cli.apart import report_apart
    from tega_study.plan import read_plan
    from tega_study.silico import unfinished
    from tega_study.silico.sensitivity import VARIED, run_sensitivity

    with trials_displayed() as progress:
        left = run_sensitivity(folder, varied=vary or VARIED, progress=progress, **requested)
    page = None if unfinished(folder, read_plan(folder)) else report_apart(folder)
    if as_json:
        echo_json({"out": str(folder), "left": left, "report": page and str(page)})
        return
    if left:
        click.echo(f"{folder}: {len(left)} changes are left to other shards")
    click.echo(
        f"{page}" if page else f"{folder}: the study itself is not done; its report will have the table"
    )
