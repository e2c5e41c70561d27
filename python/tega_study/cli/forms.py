"""Write a study's consent form and data protection sheet: ``tega-teleop study forms``."""

from __future__ import annotations

from pathlib import Path

import click

from tega.ui.cli.options import echo_json, json_option
from tega_study.cli.options import FOLDER, folder_argument


@click.command(epilog="Example: tega-teleop study forms my-study --out forms")
@folder_argument
@click.option("--out", type=FOLDER, required=True, help="Folder for the forms; no form in it is overwritten.")
@json_option
def forms(*, folder: Path, out: Path, as_json: bool) -> None:
    """Write templates of a consent form and a data protection sheet, filled in from the plan.

    The forms are templates, not legal advice. Complete the parts in brackets, and have the forms approved.
    """
    from tega_study.forms import write_forms

    paths = write_forms(folder, out)
    if as_json:
        echo_json({"forms": [str(path) for path in paths]})
        return
    for path in paths:
        click.echo(f"{path}: complete what stands in [brackets], and have it approved")
