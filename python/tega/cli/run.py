"""``tega-teleop run``: a session from its settings."""

from __future__ import annotations

from pathlib import Path

import click

from tega.cli.options import debug_option, json_option
from tega.cli.page import view_options

__all__ = ["run"]


@click.command(epilog="Example: tega-teleop run session.toml --set session.pace=fast")
@click.argument("config", type=click.Path(path_type=Path), metavar="CONFIG.toml")
@click.option("--person", metavar="ID", help="Whose calibration to use (calibration.person).")
@click.option("--set", "sets", multiple=True, metavar="KEY=VALUE", help="Override a setting; repeatable.")
@click.option(
    "--record",
    type=click.Path(path_type=Path),
    metavar="DIR",
    help="Record into this session's folder (recording.dir).",
)
@click.option("--lossless", is_flag=True, help="Record the pictures as they are (recording.lossless).")
@view_options
@json_option
@debug_option
def run(
    *,
    config: Path,
    person: str | None,
    sets: tuple[str, ...],
    record: Path | None,
    lossless: bool,
    view: bool,
    view_port: int,
    as_json: bool,
) -> None:
    """Run a session: the dual loop on the devices that CONFIG.toml names, until they end or Ctrl-C.

    In a terminal the space bar or q stop it as well.

    On every way out the vest is sent zeros and the hand zero torque and SERVO OFF. With --json the summary is
    printed, with a table "measured" of wall_s and real_time_factor.
    """
    import json
    import shlex
    import sys
    import time

    from tega.cli.options import Stop, echo_json, stop_keys
    from tega.cli.page import run_viewed
    from tega.cli.report import print_summary
    from tega.cli.stage import stage
    from tega.config import load_config
    from tega.teleop import run_session

    if person is not None:
        sets = (*sets, f"calibration.person={json.dumps(person)}")
    if record is not None:
        sets = (*sets, f"recording.dir={json.dumps(str(record.absolute()))}")
    if lossless:
        sets = (*sets, "recording.lossless=true")
    settings = load_config(config, sets=sets).config
    name = shlex.quote(str(config))
    # Python lets a thread hold the interpreter for 5 ms by default, longer than a tick of the hand.
    sys.setswitchinterval(0.0005)
    heading = f"TEGA · {config.name}" + (" · space or q: stop" if sys.stdin.isatty() else "")
    started = time.perf_counter()
    with (
        Stop() as stop,
        stop_keys(stop, enabled=not as_json),
        stage(heading, enabled=not as_json) as (progress, observer),
    ):
        if view:
            summary = run_viewed(
                settings,
                title=f"TEGA · {config.name}",
                port=view_port,
                observer=observer,
                progress=progress,
                stop=stop,
                settings=name,
            )
        else:
            summary = run_session(settings, observer=observer, progress=progress, stop=stop, settings=name)
    wall_s = time.perf_counter() - started
    measured = {"wall_s": wall_s, "real_time_factor": summary["duration_s"] / wall_s}
    if as_json:
        echo_json({**summary, "measured": measured})
    else:
        print_summary(summary, measured=measured)
    if summary["ended"] == "stopped":
        raise KeyboardInterrupt
