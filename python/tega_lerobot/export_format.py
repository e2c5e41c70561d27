"""Join ``recording export``: ``--format lerobot``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from tega.runtime.lifecycle import require
from tega.ui.cli.export_format import ExportFormat
from tega.ui.cli.options import progress_bar


def _export(
    recordings: Sequence[Path], out: Path, *, fps: int, task: str | None, scenes: Sequence[str]
) -> list[Path]:
    # The help of `recording export` lists the formats, and a table needs nothing of this one.
    require("tega_scene.record", driver="export", extra="lab")
    from tega_lerobot.dataset import export_lerobot

    named = dict(one.partition("=")[::2] for one in scenes)
    if not all(named.values()) or len(named) < len(scenes):
        raise click.BadParameter("name each camera once, as NAME=VIDEO.mp4", param_hint="--scene")
    videos = {name: Path(video) for name, video in named.items()}
    with progress_bar() as progress:
        return [export_lerobot(recordings, out, fps=fps, task=task, scenes=videos, progress=progress)]


FORMAT = ExportFormat(
    options=(
        click.Option(
            ["--fps"],
            type=click.IntRange(1, 240),
            default=30,
            show_default=True,
            help="Frames per second (lerobot).",
        ),
        click.Option(["--task"], help="Task in words, for episodes that do not name one (lerobot)."),
        click.Option(
            ["--scene", "scenes"],
            multiple=True,
            metavar="NAME=VIDEO.mp4",
            help="Video of a scene camera with its time code, as scene export wrote it (lerobot); repeatable.",
        ),
    ),
    export=_export,
)
