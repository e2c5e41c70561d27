"""Re-run a recorded session and compare the output: ``tega-teleop verify``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from tega.runtime.words import printable
from tega.ui.cli.options import PATH, echo_json, json_option, picture_option, progress_bar, sets_option

if TYPE_CHECKING:
    from tega.recording.replay import Replay


@click.command(epilog="Example: tega-teleop verify sessions/monday")
@click.argument("session", type=PATH)
@click.option("--config", type=PATH, help="Run it through these settings instead.")
@sets_option
@picture_option
@json_option
def verify(
    *, session: Path, config: Path | None, sets: tuple[str, ...], picture: Path | None, as_json: bool
) -> int:
    """Re-run a recorded session, tick by tick, and check that the output is identical.

    SESSION is a recording made with run --record, or a session's folder. The exit code is 1 if anything differs.
    --config and --set apply other settings, and report the differences that result. A summary of each finger, the
    level and the vest is printed; --picture draws it (for several recordings, each into a file with its name). With
    --json: a list of objects, one per recording.
    """
    import msgspec

    from tega.recording.inspection import absent_in
    from tega.recording.mcap_folder import recording_stem, session_files
    from tega.recording.replay import replay_file
    from tega.records.bus import Bus
    from tega.ui.cli.report import Findings

    replays, files = [], session_files(session)
    for path in files:
        bus, drawn = Bus(), picture
        if picture is not None and len(files) > 1:
            drawn = picture.with_name(f"{picture.stem}-{recording_stem(path)}{picture.suffix}")
        findings = Findings(bus, drawn, required=True)
        with progress_bar(enabled=not as_json) as progress:
            replays.append(replay_file(path, config=config, sets=sets, bus=bus, progress=progress))
        if not as_json:
            _show(replays[-1])
            for sentence in absent_in(path):
                click.echo(f"  {sentence}")
        findings.notify(f"TEGA · {printable(path.name)}", pose_base=replays[-1].pose_base, words=not as_json)
    if as_json:
        echo_json(msgspec.to_builtins(replays))
    return 0 if all(replay.same for replay in replays) else 1


def _show(replay: Replay) -> None:
    from rich.text import Text

    from tega.ui.cli.report import figures_table, wide_console

    console = wide_console()
    about = f"  {replay.duration_s:.1f} s re-run{_inputs(replay)}"
    console.print(Text.assemble((printable(replay.file), "bold"), about), soft_wrap=True)
    if replay.from_s > 0:
        console.print(f"  trimmed: compared from {replay.from_s:g} s on, what came before is its lead-in")
    for change in replay.changed:
        console.print(printable(f"  changed: {change}"))
    if not replay.complete:
        console.print("  the recording was cut; compared as far as it goes")
    for topic, count in replay.dropped.items():
        lost = f"  {topic}: {count} records were dropped while recording and cannot be compared"
        console.print(printable(lost))
    table = figures_table(["stream"], ["recorded", "replayed", "differ"], box=None)
    table.add_column("where")
    table.add_column("what")
    for s in replay.streams:
        where = subject = ""
        if s.first and s.last_t_s is not None:
            where = f"{s.first[0].t_s:.3f} to {s.last_t_s:.3f} s"
            subject = ", ".join(f"{field} {count}" for field, count in list(s.fields.items())[:4])
            subject += f" and {len(s.fields) - 4} more" if len(s.fields) > 4 else ""
        replayed, differ = str(s.replayed), str(s.differ)
        if s.as_recorded:
            replayed, differ = "as recorded", differ if s.differ else "-"
        table.add_row(s.stream, str(s.recorded), replayed, differ, where, subject)
    console.print(table)
    for s in replay.streams:
        for d in s.first[:3]:
            message = f"{s.stream} at {d.t_s:.6f} s: {d.field}: {_short(d.recorded)} -> {_short(d.replayed)}"
            console.print(f"  {message}")
    kept = {name: why for name, why in _kept(replay).items() if why}
    verdict = "identical, bit for bit" if replay.same else "not identical"
    style = "green" if replay.same else "red"
    console.print(f"  {'what was computed is ' if kept else ''}{verdict}", style=style)
    for name, why in kept.items():
        console.print(f"  {name.capitalize()} are those recorded: {why}.", soft_wrap=True)
    if "contacts" in kept and any(finger.compared for finger in replay.pictures):
        console.print(
            "  --json has the differences of contacts measured again in the pictures.", soft_wrap=True
        )


def _kept(replay: Replay) -> dict[str, str]:
    """Return why contacts and levels, where there are any, were taken as recorded; ``""`` where computed."""
    names = {"contact": "contacts", "levels": "levels"}  # /tactile/FINGER/contact and /emg/levels
    kept = ((s.stream.rpartition("/")[2], s.as_recorded) for s in replay.streams)
    return {names[last]: why for last, why in kept if last in names}


def _inputs(replay: Replay) -> str:
    raw = {"contacts": "pictures", "levels": "samples"}
    kept = _kept(replay)
    if len(kept) == 2 and not any(kept.values()):
        return " from the raw pictures and samples"
    words = [f"the {name} as recorded" if why else f"the raw {raw[name]}" for name, why in kept.items()]
    return f" from {' and '.join(words)}" if words else ""


def _short(text: str) -> str:
    return text if len(text) <= 60 else f"{text[:57]}..."
