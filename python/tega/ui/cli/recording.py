"""Inspect, export, trim, merge and annotate recordings: ``tega-teleop recording``."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click
from click.core import ParameterSource

from tega.errors import ConfigError, MissingExtraError, TegaError
from tega.runtime.declaration import OWN_NAMES
from tega.runtime.features import load_target, named, warn
from tega.runtime.words import printable
from tega.ui.cli.export_format import ExportFormat
from tega.ui.cli.guest_group import GuestGroup
from tega.ui.cli.options import FILE, PATH, FiniteRange, answer, echo_json, json_option, progress_bar

if TYPE_CHECKING:
    from tega.recording.inspection import Inspection
    from tega.runtime.files.annotations import CodedEvent


@click.command(epilog="Example: tega-teleop recording inspect sessions/monday")
@click.argument("session", type=PATH)
@json_option
def inspect(*, session: Path, as_json: bool) -> None:
    """Print the contents of a recording: streams, true rates, gaps, losses, latency, markers, versions.

    SESSION is a file, or the folder of a session with all its files. An unfinished file is finished first. With
    --json: a list of objects, one per file.
    """
    import msgspec

    from tega.recording.inspection import inspect_file
    from tega.recording.mcap_folder import session_files

    found = [inspect_file(path) for path in session_files(session)]
    if as_json:
        echo_json(msgspec.to_builtins(found))
        return
    for inspection in found:
        _show(inspection)


def _show(found: Inspection) -> None:
    from datetime import UTC, datetime

    from rich.text import Text

    from tega.config.person import ONSET_STAGE
    from tega.recording.origin import SPAN, Span, span
    from tega.ui.cli.report import figures_table, wide_console

    console = wide_console()
    started = datetime.fromtimestamp(found.start / 1e9, UTC)
    state = "complete" if found.complete else "not finished by its run, read as far as it goes"
    if found.cut:
        state = f"damaged or cut ({found.cut}); what comes before that is listed"
    if found.stopped:
        state = printable(f"ended before its run: {found.stopped}")
    about = f"  {found.duration_s:.1f} s, {found.mib:.1f} MiB, {state}"
    console.print(Text.assemble((printable(found.file), "bold"), about))
    kind = "lossless" if found.lossless else "pictures as JPEG"
    console.print(f"  {kind}; begun {started:%Y-%m-%d %H:%M:%S} UTC; ended: {found.ended or 'not recorded'}")
    for step in found.origin:
        part = span({SPAN: step})
        subject = f"{step['session']}/{step['file']}" + (f", {part}" if part != Span() else "")
        console.print(printable(f"  made by {step['made_by']} from {subject}"))
    for source in (*(f"{name}: {label}" for name, label in found.sources.items()), *found.absent):
        console.print(printable(f"  {source}"))
    figures = ["messages", "rate Hz", "usual ms", "longest", "gaps", "missing", "dropped", "MiB"]
    table = figures_table(["stream"], figures, box=None)
    for s in found.streams:
        table.add_row(
            printable(s.topic),
            str(s.messages),
            *(_number(value, 2) for value in (s.rate_hz, s.median_ms, s.longest_ms)),
            _number(s.gaps, 0),
            *(str(count) if count else "-" for count in (s.missing, s.dropped)),
            f"{s.mib:.2f}",
        )
    console.print(table)
    for s in (s for s in found.streams if s.back):
        console.print(printable(f"  {s.topic}: {s.back} stamps step back; rate and gaps are of the arrivals"))
    if found.latency:
        table = figures_table(["latency"], ["n", "p50 ms", "p95 ms", "p99 ms", "worst ms"], box=None)
        for stage in found.latency:
            times_ms = (stage.p50_ms, stage.p95_ms, stage.p99_ms, stage.worst_ms)
            table.add_row(stage.stage, str(stage.n), *(_number(time_ms, 2) for time_ms in times_ms))
        console.print(table)
        stages = [stage.stage for stage in found.latency]
        if "camera to vest: whole" in stages and not any(stage.startswith(ONSET_STAGE) for stage in stages):
            console.print(
                f"  {ONSET_STAGE}: not measured when this was recorded; the latency ends at the vest's transport"
            )
    for title, lines in (("markers", found.markers), ("states", found.states), ("log", found.log)):
        if lines:
            console.print(f"  {title}:")
        for line in lines:
            console.print(printable(f"    {line.t_s:9.3f} s  {line.text}"))
    console.print(f"  settings {found.config_sha256[:16]}")
    versions = ", ".join(f"{name} {version}" for name, version in found.versions.items())
    console.print(printable(f"  {versions}"))


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


def _guest_formats() -> dict[str, ExportFormat]:
    """Return the formats of features by name; one that cannot be loaded, or has a taken option, is left out."""
    found: dict[str, ExportFormat] = {}
    taken = _names(export.params)
    for name, (feature, target) in named("formats").items():
        try:
            loaded = load_target(target, feature, ExportFormat, "tega.ui.cli.export_format.ExportFormat")
            names = _names(loaded.options)
            if clash := sorted(names & taken):
                hint = f"update {feature.package}, or report it to its authors"
                raise ConfigError(f"recording export has an option {clash[0]} already", hint)
            found[name], taken = loaded, taken | names
        except MissingExtraError:
            pass  # named where the format is chosen
        except TegaError as error:
            warn(f"format {name!r} is left out: {error.message}", error.hint)
    return found


def _names(options: Sequence[click.Parameter]) -> set[str]:
    return {name for one in options for name in (one.name or "", *one.opts, *one.secondary_opts)}


class _Export(click.Command):
    def get_params(self, ctx: click.Context) -> list[click.Parameter]:
        guests = [option for one in _guest_formats().values() for option in one.options]
        return [*super().get_params(ctx), *guests]


def _check_format(_ctx: click.Context, _param: click.Parameter, value: str) -> str:
    guests = named("formats")
    if value in guests:
        feature, target = guests[value]
        # It names the package that it lacks.
        load_target(target, feature, ExportFormat, "tega.ui.cli.export_format.ExportFormat")
    elif value not in OWN_NAMES["formats"]:
        raise click.BadParameter(f"{value!r} is not one of {', '.join((*OWN_NAMES['formats'], *guests))}")
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
    from tega.recording.export import export_file
    from tega.recording.mcap_folder import recording_stem, session_files

    formats = _guest_formats()
    for name, option in ((name, option) for name, one in formats.items() for option in one.options):
        if name != kind and ctx.get_parameter_source(option.name) is not ParameterSource.DEFAULT:
            raise click.UsageError(f"{option.opts[0]} is for --format {name}")
    files = session_files(session)
    if kind in formats:
        if pictures:
            raise click.UsageError("--pictures is for tables")
        values = {option.name: ctx.params[option.name] for option in formats[kind].options}
        made = list(formats[kind].export(files, out, **values))
    else:
        made = []
        for path in files:
            target = out / recording_stem(path) if session.is_dir() else out
            with progress_bar() as progress:
                made += export_file(path, target, kind=kind, pictures=pictures, progress=progress)
    _echo_paths(made, as_json=as_json)


def _echo_paths(made: Sequence[Path], *, as_json: bool) -> None:
    paths = [str(path) for path in made]
    answer(paths, paths, as_json=as_json)


@click.command(
    epilog="Example: tega-teleop recording trim sessions/monday --from 12 --to 30 --out sessions/monday-lift"
)
@click.argument("session", type=PATH)
@click.option(
    "--from",
    "from_s",
    type=FiniteRange(min=0),
    default=0.0,
    help="Start of the part, seconds since the recording's start.",
)
@click.option(
    "--to",
    "to_s",
    type=FiniteRange(min=0),
    help="End of the part, seconds since the recording's start; else the recording's end.",
)
@click.option("--out", type=PATH, help="Folder: new or empty; SESSION-FROM-TO if left out.")
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
    from tega.recording.mcap_folder import recording_stem
    from tega.recording.trim import trim_session

    if out is None:
        end, place = "end" if to_s is None else f"{to_s:g}s", session.resolve()
        folder, part = (place, "") if place.is_dir() else (place.parent, f"-{recording_stem(place)}")
        out = folder.parent / f"{folder.name}{part}-{from_s:g}s-{end}"
    _echo_paths(
        [trim_session(session, from_s=from_s, to_s=to_s, out=out, lead_in=not no_lead_in)], as_json=as_json
    )


@click.command(
    epilog="Example: tega-teleop recording merge sessions/monday sessions/tuesday --out sessions/both"
)
@click.argument("sessions", type=PATH, nargs=-1, required=True)
@click.option("--out", type=PATH, required=True, help="Folder: new or empty.")
@json_option
def merge(*, sessions: tuple[Path, ...], out: Path, as_json: bool) -> None:
    """Copy the recordings of several sessions into a new one, in order of time.

    SESSIONS are files, or folders of sessions; they are not changed. Recordings that overlap in time, or differ in
    versions, calibration, vest or inputs, are rejected.
    """
    from tega.recording.remake import merge_sessions

    _echo_paths(merge_sessions(list(sessions), out=out), as_json=as_json)


@click.command(
    epilog="Example: tega-teleop recording annotate trial-001.mcap --import coded.boris --rater r1"
)
@click.argument("recording", type=FILE)
@click.option(
    "--import",
    "taken",
    type=FILE,
    metavar="FILE",
    help="Events to import: a BORIS project, its tabular or aggregated events, or an ELAN file.",
)
@click.option("--rater", metavar="ID", help="With --import: code of the rater of these events.")
@click.option("--boris", type=FILE, metavar="OUT.boris", help="BORIS project to write.")
@click.option("--elan", type=FILE, metavar="OUT.eaf", help="ELAN file to write.")
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
    lines = [_line(one, event) for one, event in rows]
    lines = lines or ["no annotations; code some with: tega-teleop play --view --rater ID"]
    answer([{"rater": one, **event._asdict()} for one, event in rows], lines, as_json=as_json)


def _line(rater: str, event: CodedEvent) -> str:
    lasted = "no end" if event.duration_s is None else f"{event.duration_s:.3f} s" if event.duration_s else ""
    more = "  ".join(text for text in ("|".join(event.modifiers), event.comment) if text)
    return f"{event.t_s:10.3f} s  {lasted:>9}  {event.code:<16} {rater:<8} {more}".rstrip()


@click.group(cls=GuestGroup, epilog="Example: tega-teleop recording inspect sessions/monday")
def recording() -> None:
    """Inspect, export, trim, merge and annotate recordings; take, relabel and re-encode episodes."""


for _verb in (inspect, export, trim, merge, annotate):
    recording.add_command(_verb)
