"""Write a recording as tables and pictures, or in a feature's format: ``tega-teleop recording export``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import click

from tega.errors import MissingExtraError, TegaError
from tega.runtime.features import load_target, named, warn
from tega.ui.cli.export_format import ExportFormat
from tega.ui.cli.options import PATH, echo_json, json_option, progress_bar

_TABLES = ("csv", "parquet")


def _guest_formats() -> dict[str, ExportFormat]:
    """Return the formats of features by name; one that cannot be loaded is left out."""
    found: dict[str, ExportFormat] = {}
    for name, (feature, target) in named("formats").items():
        try:
            found[name] = load_target(target, feature, ExportFormat, "ExportFormat")
        except MissingExtraError:
            pass  # named where the format is chosen
        except TegaError as error:
            warn(f"format {name!r} is left out: {error.message}", error.hint)
    return found


class _Export(click.Command):
    """The command with the options of every format."""

    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        """Return the own options and those of features' formats."""
        guests = [option for one in _guest_formats().values() for option in one.options]
        return [*super().get_params(ctx), *guests]


def _check_format(_ctx: click.Context, _param: click.Parameter, value: str) -> str:
    guests = named("formats")
    if value in guests:
        feature, target = guests[value]
        load_target(target, feature, ExportFormat, "ExportFormat")  # names the package that it lacks
    elif value not in _TABLES:
        raise click.BadParameter(f"{value!r} is not one of {', '.join((*_TABLES, *guests))}")
    return value


@click.command(
    cls=_Export, epilog="Example: tega-teleop recording export sessions/monday --out tables --pictures"
)
@click.argument("session", type=PATH)
@click.option("--out", type=PATH, required=True, help="Folder: new or empty.")
@click.option(
    "--format",
    "kind",
    callback=_check_format,
    default="csv",
    show_default=True,
    metavar="FORMAT",
    help="csv or parquet for tables, or a feature's format such as lerobot.",
)
@click.option(
    "--pictures", is_flag=True, help="Write every picture, too, in a folder per finger (csv, parquet)."
)
@json_option
@click.pass_context
def export(
    ctx: click.Context,
    /,
    *,
    session: Path,
    out: Path,
    kind: Any,
    pictures: bool,
    as_json: bool,
    **_guest_options: Any,
) -> None:
    """Write a recording as one table per stream, with its settings and calibration beside them.

    SESSION is a file, or a session's folder, which gives a folder per recording. With --format lerobot it writes one
    dataset in the format LeRobot v3.0 instead, with an episode per recording and the pictures as video. With --json:
    the paths of the tables, or that of the dataset.

    EMG can identify a person, in tables and in datasets: publish them only with that person's consent.
    """
    from tega.recording.mcap_folder import session_files

    formats = _guest_formats()
    for name, one in formats.items():
        if name != kind and (given := one.given(ctx)):
            raise click.UsageError(f"{given[0]} is for --format {name}")
    files = session_files(session)
    if kind in formats:
        if pictures:
            raise click.UsageError("--pictures is for tables")
        made: Sequence[Path] = formats[kind].export(files, out, **formats[kind].values(ctx))
    else:
        made = _tables(files, out, kind=kind, pictures=pictures, folders=session.is_dir())
    if as_json:
        echo_json([str(path) for path in made])
        return
    for path in made:
        click.echo(path)


def _tables(files: Sequence[Path], out: Path, *, kind: Any, pictures: bool, folders: bool) -> list[Path]:
    """Write the tables of each recording, in a folder of its own where there are several."""
    from tega.recording.export import export_file

    made: list[Path] = []
    for path in files:
        target = out / path.stem if folders else out
        with progress_bar() as progress:
            made += export_file(path, target, kind=kind, pictures=pictures, progress=progress)
    return made
