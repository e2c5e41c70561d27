"""Delete or hand on data: ``tega-teleop study withdraw``, ``export``, ``bundle`` and ``open``."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from tega.ui.cli.options import FILE, answer, json_option
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
    answer(
        {"participant": participant, **{k: [str(p) for p in v] for k, v in gone._asdict().items()}},
        [
            *(f"deleted {path}" for path in gone.deleted),
            *(f"taken out of {path}" for path in gone.changed),
            *(f"not deleted, look at it by hand: {path}" for path in gone.left),
            f"{participant} has withdrawn; backups and earlier exports have to be deleted by hand",
        ],
        as_json=as_json,
    )


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

    from tega_study.emg_bids.dataset import export_bids
    from tega_study.privacy import export as copy

    if not bids:
        new = copy(folder, out, key=secrets.token_hex(32))
        lines = [f"{out}: {len(new)} people under new ids"]
        answer({"out": str(out), "participants": len(new)}, lines, as_json=as_json)
        return
    made = export_bids(folder, out)
    runs = [path.relative_to(out).as_posix() for path in made.runs]
    if not as_json:
        for line in made.left_out:
            click.echo(f"left out: {line}", err=True)
    value = {"out": str(out), "people": made.people, "runs": runs, "left_out": made.left_out}
    answer(value, [f"{out}: {len(made.people)} people, {len(runs)} runs"], as_json=as_json)


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
    counts = {"files": len(manifest.files), "bytes": n_bytes, "trials": len(manifest.trials)}
    left = [str(path) for path in left_out]
    if not as_json:
        for path in left:
            click.echo(f"left out, a link or a name that other computers refuse: {path}", err=True)
    size = f"{len(manifest.trials)} trials, {len(manifest.files)} files, {n_bytes / 1e6:.1f} MB"
    value = {"out": str(out), "participant": participant, **counts, "left_out": left}
    answer(value, [f"{out}: {participant}, {size}"], as_json=as_json)


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
    head = {"out": str(folder), "participant": manifest.participant, "files": len(manifest.files)}
    about = {"rehearsed": manifest.rehearsed, "written_by": manifest.written_by}
    lines = [
        f"{folder}: {manifest.participant}, {len(manifest.files)} files, every hash is right; written by TEGA "
        f"{manifest.written_by.get('tega', 'of an unknown version')}"
    ]
    if manifest.rehearsed:
        lines.append("not data of a person: the session ran on simulated or emulated devices")
    for condition in dict.fromkeys(trial.condition for trial in trials):
        mine = [trial for trial in trials if trial.condition == condition and trial.counts]
        lines.append(
            f"  {condition}: {len(mine)} trials that count, {sum(t.success for t in mine)} successes, "
            f"{sum(t.slips for t in mine)} slips, {sum(t.deformations for t in mine)} deformations"
        )
    same = "the same" if opened.same else "NOT the same as where the bundle was written"
    lines.append(f"{len(trials)} trials, worked out again: {same}")
    lines.append(f"tega-teleop study report {folder} --unblind makes its tables and figures")
    answer({**head, "trials": len(trials), "same": opened.same, **about}, lines, as_json=as_json)
    if not opened.same:
        sys.exit(1)
