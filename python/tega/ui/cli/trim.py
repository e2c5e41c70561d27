"""Cut and join recorded sessions: ``tega-teleop recording trim`` and ``merge``."""

from __future__ import annotations

from pathlib import Path

import click

from tega.ui.cli.options import echo_json, json_option


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
    from tega.recording.merge import merge_sessions

    made = merge_sessions(list(sessions), out=out)
    if as_json:
        echo_json([str(path) for path in made])
        return
    for path in made:
        click.echo(path)
