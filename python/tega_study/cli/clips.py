"""Make blind clips for raters who code in BORIS, and take their coding back: ``tega-teleop study clips``."""

from __future__ import annotations

from pathlib import Path

import click

from tega.ui.cli.options import echo_json, json_option, progress_bar
from tega_study.cli.options import FILE, FOLDER, folder_argument


@click.command(epilog="Example: tega-teleop study clips my-study r3-clips --rater r3")
@folder_argument
@click.argument("out", type=FOLDER, required=False)
@click.option(
    "--rater", metavar="ID", required=True, help="Code of the rater who gets the clips; it must be new."
)
@click.option(
    "--proposals",
    is_flag=True,
    help="Put the events that rule and detector found into the project, for the rater to decide.",
)
@click.option(
    "--scene", "scenes", multiple=True, type=FILE, metavar="SCENE.mcap",
    help="Scene recording of the sessions, which shows the object in the clips; repeatable.",
)  # fmt: skip
@click.option(
    "--take",
    type=FILE,
    metavar="FILE.boris",
    help="BORIS project with the rater's codes to take in.",
)
@json_option
def clips(
    *,
    folder: Path,
    out: Path | None,
    rater: str,
    proposals: bool,
    scenes: tuple[Path, ...],
    take: Path | None,
    as_json: bool,
) -> None:
    """Make blind, shuffled clips of the recorded trials with a BORIS project, or take one back with --take.

    Clips show fingertips, and what scene cameras of the settings or --scene filmed, in an order of the rater's own.
    With --proposals events of rule and detector stand in the project; the modifier "proposal" confirms or rejects each,
    and a shifted time moves it. Then study score compares; a rater who saw proposals is not compared with rule or
    detector.

    With --json: {"project", "clips", "left_out"}, or with --take {"trials", "unfinished", "added", "proposals"}.
    """
    import msgspec

    if (out is None) == (take is None):
        raise click.UsageError("name the folder OUT to make clips, or --take FILE.boris to take them back")
    if take is not None:
        from tega_study.score.clips_coded import take_clips

        taken = take_clips(folder, take, rater)
        if as_json:
            echo_json(msgspec.to_builtins(taken))
            return
        for person, n in taken.trials.items():
            click.echo(f"{person}: {n} trials of rater {rater} taken in")
        for source, counts in taken.proposals.items():
            click.echo(
                f"proposed by {source}: {', '.join(f'{n} {verdict}' for verdict, n in counts.items())}"
            )
        click.echo(f"added by {rater}: {taken.added}")
        if taken.unfinished:
            click.echo(f"with open proposals, counted in no comparison: {', '.join(taken.unfinished)}")
        return
    assert out is not None
    from tega_study.score.clips import make_clips

    with progress_bar(enabled=not as_json) as displayed:
        key = make_clips(
            folder,
            out,
            rater,
            proposals=proposals,
            scenes=scenes,
            reported=lambda done, total: displayed("clips", done, total),
        )
    project = out / f"{rater}.boris"
    if as_json:
        echo_json({"project": str(project), "clips": len(key.clips), "left_out": key.left_out})
        return
    click.echo(f"{len(key.clips)} clips; open {project} in BORIS, save it there, then:")
    click.echo(f"  tega-teleop study clips {folder} --rater {rater} --take {project}")
    for line in key.left_out:
        click.echo(f"left out: {line}")
