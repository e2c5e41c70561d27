"""Group the verbs on recordings: ``tega-teleop recording``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from tega.ui.cli.export import export
from tega.ui.cli.guest_group import GuestGroup
from tega.ui.cli.inspect import inspect
from tega.ui.cli.options import echo_json, json_option

if TYPE_CHECKING:
    from tega.runtime.files.annotations import CodedEvent


@click.command(
    epilog="Example: tega-teleop recording trim sessions/monday --from 12 --to 30 --out sessions/monday-lift"
)
@click.argument("session", type=click.Path(path_type=Path))
@click.option(
    "--from",
    "from_s",
    type=click.FloatRange(min=0),
    default=0.0,
    help="Start of the part, seconds since the recording's start.",
)
@click.option(
    "--to",
    "to_s",
    type=click.FloatRange(min=0),
    help="End of the part, seconds since the recording's start; else the recording's end.",
)
@click.option(
    "--out", type=click.Path(path_type=Path), help="Folder: new or empty; SESSION-FROM-TO if left out."
)
@click.option(
    "--no-lead-in", is_flag=True, help="Leave out what came before; the part then cannot be computed again."
)
@json_option
def trim(
    *, session: Path, from_s: float, to_s: float | None, out: Path | None, no_lead_in: bool, as_json: bool
) -> None:
    """Write a part of a recording into a new session; every message keeps its time stamps.

    SESSION is a file, or the folder of a session with one recording; it is not changed. All EMG samples and results
    from before the part are attached, without pictures; verify needs them to re-run the part bit for bit. EMG can
    identify a person: to leave the samples out, use --no-lead-in.
    """
    from tega.recording.trim import trim_session

    if out is None:
        end = "end" if to_s is None else f"{to_s:g}s"
        name = session.resolve()
        named = name.name if name.is_dir() else f"{name.parent.name}-{name.stem}"
        out = (name.parent if name.is_dir() else name.parent.parent) / f"{named}-{from_s:g}s-{end}"
    made = trim_session(session, from_s=from_s, to_s=to_s, out=out, lead_in=not no_lead_in)
    if as_json:
        echo_json([str(made)])
        return
    click.echo(made)


@click.command(
    epilog="Example: tega-teleop recording merge sessions/monday sessions/tuesday --out sessions/both"
)
@click.argument("sessions", type=click.Path(path_type=Path), nargs=-1, required=True)
@click.option("--out", type=click.Path(path_type=Path), required=True, help="Folder: new or empty.")
@json_option
def merge(*, sessions: tuple[Path, ...], out: Path, as_json: bool) -> None:
    """Copy the recordings of several sessions into a new one, in order of time.

    SESSIONS are files, or folders of sessions; they are not changed. Recordings that overlap in time, or differ in
    versions, calibration, vest or inputs, are rejected.
    """
    from tega.recording.remake import merge_sessions

    made = merge_sessions(list(sessions), out=out)
    if as_json:
        echo_json([str(path) for path in made])
        return
    for path in made:
        click.echo(path)


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
    from tega.recording.annotations import export_annotations, import_annotations, read_annotations

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


@click.group(cls=GuestGroup, epilog="Example: tega-teleop recording inspect sessions/monday")
def recording() -> None:
    """Inspect, export, trim, merge and annotate recordings; take, relabel and re-encode episodes."""


for _verb in (inspect, export, trim, merge, annotate):
    recording.add_command(_verb)
