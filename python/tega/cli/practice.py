"""Practise to follow a level with the muscles, for a score: ``tega-teleop practice``."""

from __future__ import annotations

import json
from pathlib import Path

import click

from tega.cli.options import json_option


@click.command(epilog="Example: tega-teleop practice lab.toml --person p01 --seconds 60")
@click.argument("settings", type=click.Path(path_type=Path), metavar="SETTINGS.toml")
@click.option("--person", required=True, metavar="ID", help="Whose calibration.")
@click.option(
    "--seconds", type=click.FloatRange(10, 600), default=60.0, show_default=True, help="How long it lasts."
)
@click.option("--seed", type=int, default=0, show_default=True, help="Of the curve.")
@click.option("--yes", is_flag=True, help="Begin without waiting for Enter.")
@click.option("--set", "sets", multiple=True, metavar="KEY=VALUE", help="Override a setting; repeatable.")
@json_option
def practice(
    *, settings: Path, person: str, seconds: float, seed: int, yes: bool, sets: tuple[str, ...], as_json: bool
) -> None:
    """Practise to follow a target level with the muscles; keep the score with the calibration.

    With --json: {"person", "seconds", "seed", "in_target_percent", "rms_error_levels", "delay_s", "file"}.
    """
    from tega.calibration.tracking import track
    from tega.cli.guide import TerminalGuide, guide_for
    from tega.cli.options import echo_json
    from tega.config import load_config

    config = load_config(settings, sets=(*sets, f"calibration.person={json.dumps(person)}")).config
    guide = guide_for(yes=yes, get_ready_s=1.0)
    try:
        record, file = track(config, guide, duration_s=seconds, seed=seed, settings=str(settings))
    finally:
        if isinstance(guide, TerminalGuide):
            guide.close()
    behind = "" if record.delay_s is None else f"; {record.delay_s:.2f} s behind"
    guide.say(
        f"On the level asked for {record.in_target_percent:.0f} % of the time; off by {record.rms_error_levels:.2f} "
        f"levels (RMS){behind}",
        tone="good",
    )
    if as_json:
        echo_json(
            {
                "person": person,
                "seconds": seconds,
                "seed": seed,
                "in_target_percent": record.in_target_percent,
                "rms_error_levels": record.rms_error_levels,
                "delay_s": record.delay_s,
                "file": str(file),
            }
        )
