"""``tega-teleop export``: a recording as tables and pictures."""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import click

from tega.cli.options import debug_option, json_option

__all__ = ["export"]


@click.command(epilog="Example: tega-teleop export sessions/monday --out tables --pictures")
@click.argument("session", type=click.Path(path_type=Path))
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder: new or empty.")
@click.option("--format", "kind", type=click.Choice(["csv", "parquet"]), default="csv", show_default=True)
@click.option("--pictures", is_flag=True, help="Every picture too, in a folder per finger.")
@json_option
@debug_option
def export(
    *, session: Path, out: Path, kind: Literal["csv", "parquet"], pictures: bool, as_json: bool
) -> None:
    """Write a recording as one table per stream, with its settings and calibration beside them.

    SESSION is a file, or a session's folder: then there is a folder per recording. With --json: the tables' paths.
    """
    from tega.cli.options import echo_json
    from tega.recording.export import export_file
    from tega.recording.mcap_folder import session_files

    tables = []
    for path in session_files(session):
        folder = out / path.stem if session.is_dir() else out
        tables += export_file(path, folder, kind=kind, pictures=pictures)
    if as_json:
        echo_json([str(table) for table in tables])
        return
    for table in tables:
        click.echo(table)
