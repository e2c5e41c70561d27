"""Calibrate for a person, and refresh it in twenty seconds: ``tega-teleop calibrate``."""

from __future__ import annotations

import json
import shlex
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from tega.ui.cli.options import (
    PATH,
    FiniteRange,
    calibrated_person_option,
    echo_json,
    json_option,
    sets_option,
    time_scale_option,
    worn_by,
    yes_option,
)

if TYPE_CHECKING:
    from tega.config import SessionConfig
    from tega.config.calibration.folder import OwnHand


@click.command(epilog="Example: tega-teleop calibrate lab.toml --person p01 --only emg")
@click.argument("settings", type=PATH, metavar="SETTINGS.toml")
@calibrated_person_option
@click.option(
    "--only",
    type=click.Choice(["tactile", "emg", "vest", "arm"]),
    multiple=True,
    help="Only this part; repeatable.",
)
@click.option(
    "--hand",
    type=click.Choice(["left", "right"]),
    help="The hand that steers, set once: forearm of the arm and columns of the vest follow it in every run.",
)
@click.option(
    "--refresh",
    is_flag=True,
    help="Measure baselines and EMG again, in twenty seconds, after sensors or electrodes moved or were put on again; "
    "a learned model is fitted to today too, into a new file.",
)
@click.option("--restart", is_flag=True, help="Do not go on with an interrupted calibration.")
@click.option(
    "--ceiling",
    type=click.IntRange(10, 100),
    default=60,
    show_default=True,
    metavar="PERCENT",
    help="The strongest vibration shown on the vest.",
)
@click.option("--each-motor", is_flag=True, help="Ask about every motor of the vest, not about its columns.")
@click.option("--each-step", is_flag=True, help="Look for the step at every column, not at one of each face.")
@click.option(
    "--pause-s",
    type=FiniteRange(0, 300),
    default=30.0,
    show_default=True,
    metavar="SECONDS",
    help="Rest between strong squeezes.",
)
@click.option(
    "--known-ball",
    type=(FiniteRange(1, 100), FiniteRange(0.1, 30)),
    metavar="MM NEWTON",
    help="A ball's diameter and the force you press it with, by a scale: fits depth and force. Never needed.",
)
@yes_option
@time_scale_option
@sets_option
@json_option
def calibrate(
    *,
    settings: Path,
    person: str,
    only: tuple[Any, ...],
    hand: OwnHand | None,
    refresh: bool,
    restart: bool,
    ceiling: int,
    each_motor: bool,
    each_step: bool,
    pause_s: float,
    known_ball: tuple[float, float] | None,
    yes: bool,
    time_scale: float,
    sets: tuple[str, ...],
    as_json: bool,
) -> None:
    """Calibrate the devices of SETTINGS.toml for one person, step by step.

    Fingertips: a baseline, then presses with a round and a flat object. Muscles: rest, three squeezes, and each
    muscle alone. Vest: the place of each column, the weakest vibration that is felt, the smallest noticeable step.
    Forearm: the forward direction. Ctrl-C keeps the finished steps, and the same command continues after them. When
    finished, run: tega-teleop run SETTINGS.toml --person ID. Files are kept in calibration.folder, else in
    'calibrations' beside SETTINGS.toml.

    --refresh writes no muscles if a channel gives less than a quarter or more than four times its calibrated value, or
    if rest and effort cannot be distinguished.

    With --json: {"person", "folder", "refresh", "finished", "done", "left", "files": [{"file", "record"}]}.
    """
    from tega.config.calibration.folder import CalibrationFolder
    from tega.config.calibration.records import utc_now
    from tega.setup.calibration.presses import Ball
    from tega.setup.calibration.refresh import refresh as refresh_all
    from tega.setup.calibration.sitting import Sitting, Times
    from tega.setup.calibration.steps_vest import VestChoices
    from tega.setup.calibration.wizard import Calibrating, parts_of
    from tega.ui.cli.guide_page import guided

    config, kept = _settings(settings, person, sets)
    if hand is not None:
        CalibrationFolder(kept).keep_hand(person, hand)
        there = f"calibration.folder={json.dumps(str(kept), ensure_ascii=False)}"
        config, _ = _settings(settings, person, (*sets, there))
    parts = parts_of(config, only)
    times = Times(pause_s=pause_s).scaled(time_scale)
    home = CalibrationFolder(kept)
    home.person(person)
    where = [word for one in sets if one.startswith("calibration.folder=") for word in ("--set", one)]
    given = (*(("--only", name) for name in only), *(("--set", one) for one in sets))
    same = [word for words in given for word in words]
    again = shlex.join(["tega-teleop", "calibrate", str(settings), "--person", person, *same])
    verb = "run" if parts == parts_of(config) else "doctor"  # which names the parts that are left
    then = shlex.join(["tega-teleop", verb, str(settings), "--person", person, *where])
    with guided("TEGA calibration", yes=yes, get_ready_s=times.get_ready_s) as guide:
        sitting = Sitting(config, person, home, guide, times, utc_now)
        work = Calibrating(
            sitting,
            vest=VestChoices(ceiling, each_motor, each_step, seed=sum(person.encode())),
            ball=None if known_ball is None else Ball(*known_ball),
        )
        files, finished = work.files, False
        try:
            if refresh:
                files = refresh_all(sitting, parts)
            else:
                work.run(parts, restart=restart)
            finished = True
        finally:
            done = ", ".join(work.done) or "nothing yet"
            if finished:
                guide.say(f"Finished. {then}", tone="good")
            elif work.left:
                left = f"Left: {', '.join(work.left)}. Go on with: {again} (with --restart all is measured again)"
                guide.say(f"Done and kept: {done}. {left}", tone="warn")
            if as_json:
                reported: dict[str, Any] = {"person": person, "folder": str(kept), "refresh": refresh}
                reported |= {"finished": finished, "done": list(work.done)}
                reported |= {"left": [] if finished else work.left, "files": _reported(files)}
                echo_json(reported)


def _settings(settings: Path, person: str, sets: tuple[str, ...]) -> tuple[SessionConfig, Path]:
    """Load the settings without the person's calibration, which is about to be made."""
    from tega.config import load_config

    config = load_config(settings, sets=worn_by(person, sets)).config
    kept = config.calibration.folder or settings.absolute().parent / "calibrations"
    return config, kept


def _reported(files: list[Path]) -> list[dict[str, Any]]:
    import tomllib

    reported: list[dict[str, Any]] = []
    for file in files:
        record = file if file.suffix in {".json", ".toml"} else file.with_suffix(".toml")
        if not record.is_file():  # a model of another form
            reported.append({"file": str(file), "record": None})
            continue
        text = record.read_text(encoding="utf-8")
        tree = json.loads(text) if record.suffix == ".json" else tomllib.loads(text)
        plain = {k: v.isoformat() if hasattr(v, "isoformat") else v for k, v in tree.items()}
        reported.append({"file": str(record), "record": plain})
    return reported
