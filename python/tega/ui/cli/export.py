"""Write a recording as tables and pictures, or as a dataset to learn from: ``tega-teleop recording export``."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from tega.ui.cli.options import json_option


@click.command(
    epilog="Example: tega-teleop recording export sessions/monday --out tables --pictures, or "
    "--format lerobot --task 'lift the bottle' instead of --pictures"
)
@click.argument("session", type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder: new or empty.")
@click.option(
    "--format",
    "kind",
    type=click.Choice(["csv", "parquet", "lerobot"]),
    default="csv",
    show_default=True,
    help="Tables as CSV or Parquet, or one LeRobot dataset.",
)
@click.option(
    "--pictures", is_flag=True, help="Write every picture, too, in a folder per finger (csv, parquet)."
)
@click.option(
    "--fps", type=click.IntRange(1, 240), default=30, show_default=True, help="Frames per second (lerobot)."
)
@click.option("--task", help="What was done, in words, for episodes that do not say it themselves (lerobot).")
@click.option(
    "--scene", "scenes", multiple=True, metavar="NAME=VIDEO.mp4",
    help="A scene camera, as scene export wrote it with its time code (lerobot); repeatable.",
)  # fmt: skip
@json_option
@click.pass_context
def export(
    ctx: click.Context,
    *,
    session: Path,
    out: Path,
    kind: Literal["csv", "parquet", "lerobot"],
    pictures: bool,
    fps: int,
    task: str | None,
    scenes: tuple[str, ...],
    as_json: bool,
) -> None:
    """Write a recording as one table per stream, with its settings and calibration beside them.

    SESSION is a file, or a session's folder: then there is a folder per recording. --format lerobot writes one
    dataset of the format LeRobot v3.0 instead, each recording an episode, pictures as video. With --json: the
    tables' paths, or the dataset's.

    EMG can identify a person, in tables and datasets alike: publish either only with that person's consent.
    """
    from tega.recording.mcap_folder import session_files
    from tega.ui.cli.options import echo_json

    files = session_files(session)
    if kind == "lerobot":
        from tega_lerobot.dataset import export_lerobot

        if pictures:
            raise click.UsageError("--pictures is for tables; a dataset has them as video")
        named = dict(one.partition("=")[::2] for one in scenes)
        if not all(named.values()) or len(named) < len(scenes):
            raise click.BadParameter("name each camera once, as NAME=VIDEO.mp4", param_hint="--scene")
        videos = {name: Path(video) for name, video in named.items()}
        made = [export_lerobot(files, out, fps=fps, task=task, scenes=videos)]
    else:
        from tega.recording.export import export_file

        for name in ("fps", "task", "scenes"):
            if ctx.get_parameter_source(name) is not click.core.ParameterSource.DEFAULT:
                raise click.UsageError(
                    f"--{name.removesuffix('s') if name == 'scenes' else name} is for --format lerobot"
                )
        made = []
        for path in files:
            folder = out / path.stem if session.is_dir() else out
            made += export_file(path, folder, kind=kind, pictures=pictures)
    if as_json:
        echo_json([str(path) for path in made])
        return
    for path in made:
        click.echo(path)
