"""Practise to follow a level with the muscles, for a score: ``tega-teleop practice``."""

from __future__ import annotations

from pathlib import Path

import click

from tega.ui.cli.options import echo_json, json_option, worn_by
from tega.ui.cli.page import view_options


@click.command(epilog="Example: tega-teleop practice lab.toml --person p01 --seconds 60")
@click.argument("settings", type=click.Path(path_type=Path), metavar="SETTINGS.toml")
@click.option("--person", required=True, metavar="ID", help="Whose calibration to use.")
@click.option(
    "--seconds",
    type=click.FloatRange(10, 600),
    default=60.0,
    show_default=True,
    help="How long the practice lasts, seconds.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of the target's curve.")
@click.option("--yes", is_flag=True, help="Begin without waiting for Enter.")
@click.option("--set", "sets", multiple=True, metavar="KEY=VALUE", help="Override a setting; repeatable.")
@view_options
@json_option
def practice(
    *,
    settings: Path,
    person: str,
    seconds: float,
    seed: int,
    yes: bool,
    sets: tuple[str, ...],
    view: bool,
    view_port: int,
    as_json: bool,
) -> None:
    """Practise to follow a target level with the muscles; keep the score with the calibration.

    With --json: {"person", "decoder", "seconds", "seed", "in_target_percent", "rms_error_levels", "delay_s", "file"}.
    """
    from tega.config import load_config
    from tega.setup.calibration.tracking import track
    from tega.ui.cli.guide_page import guided

    config = load_config(settings, sets=worn_by(person, sets)).config
    port = view_port if view else None
    with guided(f"TEGA practice of {person}", yes=yes, get_ready_s=1.0, view_port=port) as guide:
        record, file = track(config, guide, duration_s=seconds, seed=seed, settings=str(settings))
        behind = "" if record.delay_s is None else f"; {record.delay_s:.2f} s behind"
        guide.say(
            f"{record.decoder}: on the level asked for {record.in_target_percent:.0f} % of the time; off by "
            f"{record.rms_error_levels:.2f} levels (RMS){behind}",
            tone="good",
        )
    if as_json:
        echo_json(
            {
                "person": person,
                "decoder": record.decoder,
                "seconds": seconds,
                "seed": seed,
                "in_target_percent": record.in_target_percent,
                "rms_error_levels": record.rms_error_levels,
                "delay_s": record.delay_s,
                "file": str(file),
            }
        )
