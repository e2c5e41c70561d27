"""Exchange annotations of a recording with BORIS and ELAN: ``tega-teleop recording annotate``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from tega.ui.cli.options import echo_json, json_option

if TYPE_CHECKING:
    from tega.runtime.files.annotations import CodedEvent

_FILE = click.Path(path_type=Path, dir_okay=False)


@click.command(
    epilog="Example: tega-teleop recording annotate trial-001.mcap --import coded.boris --rater r1"
)
@click.argument("recording", type=_FILE)
@click.option(
    "--import", "taken", type=_FILE, metavar="FILE",
    help="Events to import: a BORIS project, its tabular or aggregated events, or an ELAN file.",
)  # fmt: skip
@click.option("--rater", metavar="ID", help="With --import: code of the rater of these events.")
@click.option("--boris", type=_FILE, metavar="OUT.boris", help="BORIS project to write.")
@click.option("--elan", type=_FILE, metavar="OUT.eaf", help="ELAN file to write.")
@click.option(
    "--video",
    default="",
    metavar="NAME",
    help="Name of a video of the recording beside the written file, as scene export makes one.",
)
@json_option
def annotate(
    *,
    recording: Path,
    taken: Path | None,
    rater: str | None,
    boris: Path | None,
    elan: Path | None,
    video: str,
    as_json: bool,
) -> None:
    """List a recording's coded events, and exchange them with BORIS and ELAN.

    Times are relative to the start of the recording. From a file with several observations, the one with the
    recording's name is used. To code events by keys, use play --view --rater ID. With --json: a list of events with
    their rater.
    """
    from tega.recording.annotate import export_annotations, import_annotations
    from tega.recording.annotations import read_annotations

    if (taken is None) != (rater is None):
        raise click.UsageError("--import FILE and --rater ID belong together")
    if taken is not None and rater is not None:
        n = import_annotations(recording, taken, rater)
        click.echo(f"{n} events of rater {rater} imported", err=True)
    for path in (boris, elan):
        if path is not None:
            export_annotations(recording, path, video=video)
            click.echo(f"{path} written", err=True)
    found = read_annotations(recording)
    rows = sorted(((one, event) for one, events in found.items() for event in events), key=lambda r: r[1].t_s)
    if as_json:
        echo_json([{"rater": one, **event._asdict()} for one, event in rows])
        return
    for one, event in rows:
        click.echo(_line(one, event))
    if not rows:
        click.echo("no annotations; code some with: tega-teleop play --view --rater ID")


def _line(rater: str, event: CodedEvent) -> str:
    lasted = "no end" if event.duration_s is None else f"{event.duration_s:.3f} s" if event.duration_s else ""
    more = "  ".join(text for text in ("|".join(event.modifiers), event.comment) if text)
    return f"{event.t_s:10.3f} s  {lasted:>9}  {event.code:<16} {rater:<8} {more}".rstrip()
