"""Delete a person's data, or write an anonymised copy: ``tega-teleop study withdraw`` and ``export``."""

from __future__ import annotations

from pathlib import Path

import click

from tega.ui.cli.options import echo_json, json_option
from tega_study.cli.options import FOLDER, folder_argument, participant_argument


@click.command(epilog="Example: tega-teleop study withdraw my-study p03")
@folder_argument
@participant_argument
@click.option("--yes", is_flag=True, help="Do not ask.")
@json_option
def withdraw(*, folder: Path, participant: str, yes: bool, as_json: bool) -> None:
    """Delete everything of one person, and reports made with it. It cannot be undone.

    Links are deleted and not followed. Their targets, data elsewhere such as the person's calibration, and other
    people's files that bear the ID are listed: check them, and backups and copies, by hand.
    """
    from tega_study.plan import read_plan
    from tega_study.privacy import withdraw as delete

    read_plan(folder).of(participant)
    if not yes:
        click.confirm(f"Delete everything of {participant} for good?", abort=True, err=True)
    gone = delete(folder, participant)
    if as_json:
        echo_json({"participant": participant, **{k: [str(p) for p in v] for k, v in gone._asdict().items()}})
        return
    for path in gone.deleted:
        click.echo(f"deleted {path}")
    for path in gone.changed:
        click.echo(f"taken out of {path}")
    for path in gone.left:
        click.echo(f"not deleted, look at it by hand: {path}")
    click.echo(f"{participant} has withdrawn; backups and earlier exports have to be deleted by hand")


@click.command(epilog="Example: tega-teleop study export my-study --out my-study-open")
@folder_argument
@click.option("--out", type=FOLDER, required=True, help="New folder for the copy.")
@click.option(
    "--bids", is_flag=True, help="Write the muscle signals of all people instead, as a BIDS data set (EDF+)."
)
@json_option
def export(*, folder: Path, out: Path, bids: bool, as_json: bool) -> None:
    """Write an anonymised copy, fit to be published: new ids, no muscle signals, texts, names or dates.

    The old IDs cannot be recovered, not even by you: the key that made the new ones is thrown away.

    With --bids the IDs stay, and the signals can identify a person: share them only as that person agreed.
    """
    import secrets

    if bids:
        _export_bids(folder, out, as_json=as_json)
        return

    from tega_study.privacy import export as copy

    new = copy(folder, out, key=secrets.token_hex(32))
    if as_json:
        echo_json({"out": str(out), "participants": len(new)})
    else:
        click.echo(f"{out}: {len(new)} people under new ids")


def _export_bids(folder: Path, out: Path, *, as_json: bool) -> None:
    """Write the BIDS data set, and print its people, runs and what is left out."""
    from tega_study.emg_bids.dataset import export_bids

    made = export_bids(folder, out)
    if as_json:
        runs = [path.relative_to(out).as_posix() for path in made.runs]
        echo_json({"out": str(out), "people": made.people, "runs": runs, "left_out": made.left_out})
        return
    for line in made.left_out:
        click.echo(f"left out: {line}", err=True)
    click.echo(f"{out}: {len(made.people)} people, {len(made.runs)} runs")
