"""Write a session as one file and open it elsewhere: ``tega-teleop study bundle`` and ``open``."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from tega.ui.cli.options import echo_json, json_option
from tega_study.cli.options import FILE, FOLDER, folder_argument, participant_argument


@click.command(epilog="Example: tega-teleop study bundle my-study p01 p01.zip")
@folder_argument
@participant_argument
@click.argument("out", type=FILE)
@click.option(
    "--bids",
    is_flag=True,
    help="Name its files as BIDS does (sub-…_ses-…_task-…_run-…); study open undoes it.",
)
@json_option
def bundle(*, folder: Path, participant: str, out: Path, bids: bool, as_json: bool) -> None:
    """Write a person's session as one ZIP file: plan, events, raters, recordings, versions and a hash of each file.

    Muscle signals can identify a person: give a bundle only to whom that person agreed to.
    """
    from tega_study.bundle import write_bundle

    manifest, left_out = write_bundle(folder, participant, out, bids=bids)
    n_bytes = sum(one.n_bytes for one in manifest.files)
    if as_json:
        echo_json(
            {
                "out": str(out),
                "participant": participant,
                "files": len(manifest.files),
                "bytes": n_bytes,
                "trials": len(manifest.trials),
                "left_out": [str(path) for path in left_out],
            }
        )
        return
    for path in left_out:
        click.echo(f"left out, a link or a name that other computers refuse: {path}", err=True)
    click.echo(
        f"{out}: {participant}, {len(manifest.trials)} trials, {len(manifest.files)} files, {n_bytes / 1e6:.1f} MB"
    )


@click.command("open", epilog="Example: tega-teleop study open p01.zip --out p01-session")
@click.argument("bundle", type=FILE)
@click.option("--out", type=FOLDER, help="New folder; by default the file's name without its ending.")
@json_option
def open_(*, bundle: Path, out: Path | None, as_json: bool) -> None:
    """Check every hash of a bundle, unpack it as a study's folder, and compare its trials worked out again.

    Exit code 0 says that all trials came out the same, 1 that this version of TEGA reads some otherwise. A file that is
    not as it was written is an error, and nothing is unpacked.
    """
    from tega_study.bundle import open_bundle

    folder = bundle.with_suffix("") if out is None else out
    opened = open_bundle(bundle, folder)
    manifest, trials = opened.manifest, opened.trials
    if as_json:
        echo_json(
            {
                "out": str(folder),
                "participant": manifest.participant,
                "files": len(manifest.files),
                "trials": len(trials),
                "same": opened.same,
                "rehearsed": manifest.rehearsed,
                "written_by": manifest.written_by,
            }
        )
    else:
        click.echo(
            f"{folder}: {manifest.participant}, {len(manifest.files)} files, every hash is right; written by TEGA "
            f"{manifest.written_by.get('tega', 'of an unknown version')}"
        )
        if manifest.rehearsed:
            click.echo("not data of a person: the session ran on simulated or emulated devices")
        for condition in dict.fromkeys(trial.condition for trial in trials):
            mine = [trial for trial in trials if trial.condition == condition and trial.counts]
            click.echo(
                f"  {condition}: {len(mine)} trials that count, {sum(t.success for t in mine)} successes, "
                f"{sum(t.slips for t in mine)} slips, {sum(t.deformations for t in mine)} deformations"
            )
        same = "the same" if opened.same else "NOT the same as where the bundle was written"
        click.echo(f"{len(trials)} trials, worked out again: {same}")
        click.echo(f"tega-teleop study report {folder} --unblind makes its tables and figures")
    if not opened.same:
        sys.exit(1)
