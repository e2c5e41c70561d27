"""Print the contents of a recording: ``tega-teleop recording inspect``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import click

from tega.ui.cli.options import echo_json, json_option

if TYPE_CHECKING:
    from tega.recording.inspection import Inspection


@click.command(epilog="Example: tega-teleop recording inspect sessions/monday")
@click.argument("session", type=click.Path(path_type=Path))
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

    from tega.config.motor_onset import STAGE
    from tega.ui.cli.tables import figures_table, wide_console

    console = wide_console()
    started = datetime.fromtimestamp(found.start / 1e9, UTC)
    state = "complete" if found.complete else "not finished by its run, read as far as it goes"
    console.print(f"[bold]{found.file}[/]  {found.duration_s:.1f} s, {found.mib:.1f} MiB, {state}")
    kind = "lossless" if found.lossless else "pictures as JPEG"
    console.print(f"  {kind}; begun {started:%Y-%m-%d %H:%M:%S} UTC; ended: {found.ended or 'not recorded'}")
    for step in found.origin:
        subject = f"{step['session']}/{step['file']}"
        if step["from_ns"] != "0" or step["to_ns"]:
            end = f"{int(step['to_ns']) / 1e9:g} s" if step["to_ns"] else "its end"
            subject += f", {int(step['from_ns']) / 1e9:g} s to {end}"
        console.print(f"  made by {step['made_by']} from {subject}", markup=False)
    for source in (*(f"{name}: {label}" for name, label in found.sources.items()), *found.absent):
        console.print(f"  {source}", markup=False)
    figures = ["messages", "rate Hz", "usual ms", "longest", "gaps", "missing", "dropped", "MiB"]
    table = figures_table(["stream"], figures, box=None)
    for s in found.streams:
        table.add_row(
            s.topic,
            str(s.messages),
            _number(s.rate_hz, 2),
            _number(s.median_ms, 2),
            _number(s.longest_ms, 2),
            _number(s.gaps, 0),
            str(s.missing) if s.missing else "-",
            str(s.dropped) if s.dropped else "-",
            f"{s.mib:.2f}",
        )
    console.print(table)
    if found.latency:
        table = figures_table(["latency"], ["n", "p50 ms", "p95 ms", "p99 ms", "worst ms"], box=None)
        for stage in found.latency:
            times_ms = (stage.p50_ms, stage.p95_ms, stage.p99_ms, stage.worst_ms)
            table.add_row(stage.stage, str(stage.n), *(_number(time_ms, 2) for time_ms in times_ms))
        console.print(table)
        stages = [stage.stage for stage in found.latency]
        if "camera to vest: whole" in stages and not any(stage.startswith(STAGE) for stage in stages):
            console.print(
                f"  {STAGE}: not measured when this was recorded; the latency ends at the vest's transport"
            )
    for title, lines in (("markers", found.markers), ("states", found.states), ("log", found.log)):
        if lines:
            console.print(f"  {title}:")
        for line in lines:
            console.print(f"    {line.t_s:9.3f} s  {line.text}", markup=False)
    console.print(f"  settings {found.config_sha256[:16]}")
    console.print("  " + ", ".join(f"{name} {version}" for name, version in found.versions.items()))


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"
