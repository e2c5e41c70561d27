"""``tega-teleop demo``: the loop on made-up input, to look at."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tega.cli.options import debug_option, json_option

if TYPE_CHECKING:
    from tega.config import SessionConfig

__all__ = ["demo"]

TITLE = "TEGA demo: simulated touch and EMG"
# The object under each finger: its radius there, the force at full effort, and how late it is met.
_TOUCH = {
    "thumb": {"radius_mm": 14.0, "force_n": 4.0, "delay_s": 0.0},
    "index": {"radius_mm": 3.0, "force_n": 4.0, "delay_s": 0.15},
    "middle": {"radius_mm": 4.4, "force_n": 5.0, "delay_s": 0.25},
    "ring": {"radius_mm": 8.0, "force_n": 3.5, "delay_s": 0.4},
}


@click.command(epilog="Example: tega-teleop demo --seconds 6 --out my-demo")
@click.option("--seconds", type=click.FloatRange(3, 600), default=12.0, show_default=True, help="How long.")
@click.option("--preset", type=click.Choice(["paper", "live"]), default="live", show_default=True)
@click.option("--seed", type=click.IntRange(0, 2**31), default=1, show_default=True, help="Of the noise.")
@click.option("--fast", is_flag=True, help="Do not wait for real time.")
@click.option(
    "--out",
    "out_dir",
    type=click.Path(path_type=Path, file_okay=False),
    default=Path("tega-demo"),
    show_default=True,
    help="Folder for the tables and the picture.",
)
@json_option
@debug_option
def demo(*, seconds: float, preset: str, seed: int, fast: bool, out_dir: Path, as_json: bool) -> None:
    """See both loops work on input made up here: four pressed fingertips and three muscles. Needs nothing.

    Shows fingers, vest, muscles, hand and rates while it runs, then a summary, and writes the tables of the
    run and demo.png: the touch map of each finger and the course of the grasp. With --json the summary is printed,
    with a table "measured" of wall_s and real_time_factor. Everything in it is simulated.
    """
    import time

    from tega.cli.options import Stop, echo_json
    from tega.cli.report import print_summary
    from tega.cli.stage import stage
    from tega.errors import MissingExtraError
    from tega.teleop import run_session
    from tega.view.session import write_figure

    settings = _settings(seconds, preset, seed, out_dir, pace="fast" if fast else "real")
    started = time.perf_counter()
    with Stop() as stop, stage(TITLE, enabled=not as_json) as (progress, observer):
        summary = run_session(settings, observer=observer, progress=progress, stop=stop)
    wall_s = time.perf_counter() - started
    measured = {"wall_s": wall_s, "real_time_factor": summary["duration_s"] / wall_s}
    try:
        write_figure(settings, out_dir, out_dir / "demo.png", title=TITLE)
        left = "tables and demo.png"
    except MissingExtraError as error:  # everything but the picture is there
        click.echo(f"no picture: {error}", err=True)
        left = "tables"
    if as_json:
        echo_json({**summary, "measured": measured})
    else:
        print_summary(summary, measured=measured)
        click.echo(f"{left} are in {out_dir}")
    if summary["ended"] == "stopped":
        raise KeyboardInterrupt


def _settings(seconds: float, preset: str, seed: int, out_dir: Path, *, pace: str) -> SessionConfig:
    from tega.config import check_tree

    tree: dict[str, Any] = {
        "session": {"preset": preset, "pace": pace, "out_dir": str(out_dir)},
        "tactile": {
            finger: {
                "driver": "synthetic-touch",
                "options": {"seed": seed + number, "duration_s": seconds, **press},
            }
            for number, (finger, press) in enumerate(_TOUCH.items())
        },
        "emg": {
            "driver": "synthetic-emg",
            "kind": "raw",
            "options": {"seed": seed, "duration_s": seconds},
        },
    }
    return check_tree(tree, {}, base=Path.cwd()).config
