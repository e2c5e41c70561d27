"""Play a recorded session on a vest and a hand: ``tega-teleop play``."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

from tega.runtime.words import printable
from tega.ui.cli.options import (
    FILE,
    PATH,
    FiniteRange,
    echo_json,
    json_option,
    sets_option,
    stop_keys,
    worn_by,
    worn_option,
)
from tega.ui.cli.page import run_viewed, view_options


class _Speed(click.ParamType[float | None]):
    """A factor, or ``max``."""

    name = "x"

    def convert(self, value: Any, param: click.Parameter | None, ctx: click.Context | None) -> float | None:
        if value == "max":
            return None
        try:
            return float(value)
        except ValueError:
            self.fail(f"{value!r} is no speed, such as 0.5, 1 or max", param, ctx)


@click.command(epilog="Example: tega-teleop play sessions/monday/trial-002.mcap --to lab.toml --speed 0.5")
@click.argument("session", type=PATH)
@click.option(
    "--to",
    type=PATH,
    metavar="LAB.toml",
    help="Settings file with the vest and hand to play on (default: draw the vest in the terminal).",
)
@worn_option
@sets_option
@click.option(
    "--speed",
    type=_Speed(),
    default="1",
    show_default=True,
    help="Multiple of the recorded speed, 0.05 to 20, or 'max': as fast as possible; not allowed with real devices.",
)
@click.option(
    "--because",
    default="",
    metavar="REASON",
    help="Reason for playing faster than recorded on real devices (required, logged).",
)
@click.option(
    "--from",
    "from_s",
    type=FiniteRange(min=0),
    default=0.0,
    show_default=True,
    metavar="SECONDS",
    help="Where in the recording to begin; with --view a slider goes anywhere.",
)
@click.option(
    "--beside",
    "--scene",
    "others",
    type=FILE,
    multiple=True,
    metavar="FILE",
    help="File of the same time, such as a scene recording, shown with --view; repeatable.",
)
@click.option(
    "--rater",
    metavar="ID",
    help="Code of the rater who annotates the recording by keys of the page (--view): s slip, d deformation begins or "
    "ends, x drop, l lift-off, u undo.",
)
@view_options
@json_option
def play(
    *,
    session: Path,
    to: Path | None,
    person: str | None,
    sets: tuple[str, ...],
    speed: float | None,
    because: str,
    from_s: float,
    others: tuple[Path, ...],
    rater: str | None,
    view: bool,
    view_port: int,
    as_json: bool,
) -> None:
    """Play a recorded session on a vest and a hand: drawn, recorded or real ones.

    SESSION is a recording made with run --record, or a session's folder with one. Only the input is recorded;
    drivers, limits, states and the ways to stop are those of a run. In a terminal, stop with the space bar, q or
    Ctrl-C.

    A real hand first moves to its recorded position, for two seconds. With --json: the summary, with a table "played".
    """
    import sys
    import time
    from contextlib import nullcontext
    from functools import partial

    from tega.loop.controls import Controls
    from tega.recording.annotations import annotation_keys
    from tega.recording.mcap_folder import one_recording
    from tega.recording.replay.play import play_file, playing_to
    from tega.recording.replay.playhead import Playhead
    from tega.records.bus import Bus
    from tega.safety.stop import CtrlC
    from tega.ui.cli.report import print_summary
    from tega.ui.cli.run import stage

    if others and not view:
        raise click.UsageError("--beside is shown on the page, so it needs --view")
    if rater is not None and not view:
        raise click.UsageError("--rater annotates by keys of the page, so it needs --view")
    file = one_recording(session)
    config = playing_to(to, sets=worn_by(person, sets))
    title = f"TEGA · {printable(file.name)}"
    heading = title + (" · space or q: stop" if sys.stdin.isatty() else "")
    playhead = Playhead(from_s)
    played = partial(play_file, file, speed=speed, because=because, playhead=playhead, others=others)
    started = time.perf_counter()
    annotating = nullcontext() if rater is None else annotation_keys(file, rater, lambda: playhead.at_s)
    with (
        annotating as annotate,
        CtrlC() as stop,
        stop_keys(stop),
        stage(heading, enabled=not as_json, config=config) as (progress, display),
    ):
        bus = Bus()
        if display is not None:
            display.watch(bus)
        how: dict[str, Any] = {"progress": progress, "bus": bus}
        if view:
            how |= {"title": title, "port": view_port, "run": played}
            summary = run_viewed(config, stop=stop, playhead=playhead, annotate=annotate, **how)
        else:
            summary = played(config, controls=Controls(stop=stop), **how)
    if as_json:
        echo_json(summary)
    else:
        wall_s, run = time.perf_counter() - started, summary["played"]
        print_summary(
            summary, measured={"wall_s": wall_s, "real_time_factor": summary["duration_s"] / wall_s}
        )
        click.echo(printable(f"played {run['file']} at speed {run['speed']} from its {run['from']}"))
    if summary["ended"] == "stopped":
        raise KeyboardInterrupt
