"""Recalibrate muscles in ten seconds: ``tega-teleop emg recalibrate``."""

from __future__ import annotations

from pathlib import Path

import click

from tega.ui.cli.options import (
    calibrated_person_option,
    echo_json,
    json_option,
    sets_option,
    time_scale_option,
    worn_by,
    yes_option,
)


@click.command(epilog="Example: tega-teleop emg recalibrate lab.toml --person p01")
@click.argument("settings", type=click.Path(path_type=Path), metavar="SETTINGS.toml")
@calibrated_person_option
@click.option("--out", type=click.Path(path_type=Path, dir_okay=False), help="The new model's file.")
@yes_option
@time_scale_option
@sets_option
@json_option
def emg_recalibrate(
    *,
    settings: Path,
    person: str,
    out: Path | None,
    yes: bool,
    time_scale: float,
    sets: tuple[str, ...],
    as_json: bool,
) -> None:
    """Fit a calibrated person's muscles to today: five seconds at rest, five with the hand closed.

    For electrodes that moved, dried or were put on again. Rest and maxima of the calibration are scaled to today. If
    the settings use a learned model, it is fitted to today too, into a new file; the old one is unchanged. Nothing is
    written if a channel gives less than a quarter or more than four times its calibrated value, or if rest and effort
    cannot be distinguished. With --json: {"person", "record", "model"}.
    """
    import json

    from tega.config import load_config
    from tega.config.calibration.folder import CalibrationFolder
    from tega.config.calibration.records import utc_now
    from tega.setup.calibration.recalibrate import HALF_S, recalibrate
    from tega.setup.calibration.times import Sitting, Times
    from tega.ui.cli.guided import guided

    config = load_config(settings, sets=worn_by(person, sets)).config
    home = CalibrationFolder(config.calibration.folder or settings.absolute().parent / "calibrations")
    times = Times(rest_s=HALF_S, squeeze_s=HALF_S).scaled(time_scale)
    with guided("TEGA recalibration", yes=yes, get_ready_s=times.get_ready_s) as guide:
        found = recalibrate(Sitting(config, person, home, guide, times, utc_now), out)
    if as_json:
        model = None if found.model is None else str(found.model)
        echo_json({"person": person, "record": str(found.record), "model": model})
        return
    click.echo(f"{found.record.name}: today's rest and maxima")
    if found.model is not None:
        click.echo(f"use the new model: stages.decoder.options.model = {json.dumps(str(found.model))}")
