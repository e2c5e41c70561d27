"""Practise, test closure with Fitts' targets, and compare the results: ``practice``, ``emg fitts``, ``emg skill``."""

from __future__ import annotations

from pathlib import Path

import click

from tega.ui.cli.options import (
    NAMES,
    calibrated_person_option,
    echo_json,
    json_option,
    sets_option,
    worn_by,
)
from tega.ui.cli.page import view_options


@click.command(epilog="Example: tega-teleop practice lab.toml --person p01 --seconds 60")
@click.argument("settings", type=click.Path(path_type=Path), metavar="SETTINGS.toml")
@calibrated_person_option
@click.option(
    "--seconds",
    type=click.FloatRange(10, 600),
    default=60.0,
    show_default=True,
    help="How long the practice lasts, seconds.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of the target's curve.")
@click.option("--yes", is_flag=True, help="Begin without waiting for Enter.")
@sets_option
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
    from tega.ui.cli.guide_page import guided
    from tega_practice.tracking import track

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


@click.command(
    epilog="Example: tega-teleop emg fitts lab.toml --person p01 --set stages.decoder.name=proportional"
)
@click.argument("settings", type=click.Path(path_type=Path), metavar="SETTINGS.toml")
@calibrated_person_option
@click.option(
    "--movements",
    type=click.IntRange(1, 100),
    default=6,
    show_default=True,
    help="Movements for each distance and width.",
)
@click.option(
    "--dwell-s",
    type=click.FloatRange(0.1, 5),
    default=1.0,
    show_default=True,
    help="Seconds to stay in a target.",
)
@click.option(
    "--timeout-s",
    type=click.FloatRange(0.2, 60),
    default=10.0,
    show_default=True,
    help="Seconds after which the next target comes.",
)
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of the order.")
@click.option("--yes", is_flag=True, help="Begin without waiting for Enter.")
@sets_option
@view_options
@json_option
def emg_fitts(
    *,
    settings: Path,
    person: str,
    movements: int,
    dwell_s: float,
    timeout_s: float,
    seed: int,
    yes: bool,
    sets: tuple[str, ...],
    view: bool,
    view_port: int,
    as_json: bool,
) -> None:
    """Hit targets with the closure that the muscles ask for (ISO 9241-411); keep the result with the calibration.

    Bring the end of the lower bar into the upper one and stay. Nothing but the EMG is needed. With --json: {"person",
    "decoder", "throughput_bits_s", "completion", "path_efficiency", "overshoots", "movement_time_s", "movements",
    "conditions": [{distance, width, id_bits, effective_distance, effective_width, effective_id_bits,
    movement_time_s, throughput_bits_s, completed, movements}], "file"}.
    """
    import msgspec

    from tega.config import load_config
    from tega.ui.cli.guide_page import guided
    from tega_practice.live import fitts_test

    config = load_config(settings, sets=worn_by(person, sets)).config
    port = view_port if view else None
    with guided(f"TEGA Fitts test of {person}", yes=yes, get_ready_s=1.0, view_port=port) as guide:
        record, score, file = fitts_test(
            config,
            guide,
            movements=movements,
            dwell_s=dwell_s,
            timeout_s=timeout_s,
            seed=seed,
            settings=str(settings),
        )
        path = (
            "" if score.path_efficiency is None else f", path {100 * score.path_efficiency:.0f} % efficient"
        )
        guide.say(
            f"{record.decoder}: {score.throughput_bits_s:.2f} bits/s; hit {100 * score.completion:.0f} % of "
            f"{score.movements}{path}, {score.overshoots:.1f} overshoots a movement",
            tone="good",
        )
    if as_json:
        echo_json(
            {"person": person, "decoder": record.decoder, **msgspec.to_builtins(score), "file": str(file)}
        )


@click.command(epilog="Example: tega-teleop emg skill calibrations --decoders rules,learned")
@click.argument("folder", type=click.Path(path_type=Path, file_okay=False), metavar="CALIBRATIONS")
@click.option("--person", metavar="ID", help="Only this person's tests.")
@click.option(
    "--decoders", type=NAMES, help="Decoders; the others are compared with the first. Else all, by name."
)
@json_option
def emg_skill(*, folder: Path, person: str | None, decoders: list[str] | None, as_json: bool) -> None:
    """Compare decoders by the Fitts tests and practices kept in a folder of calibrations, with 95 % intervals.

    Within a person the interval goes over distances and widths of the Fitts tests, and over practices; over people,
    where there are two or more, it goes over people. With --json {"fitts": [decoder, person (null: over people), tests,
    unit, throughput_bits_s {mean, low, high, n}, completion, path_efficiency, overshoots, difference_bits_s (to the
    first decoder, paired)], "tracking": [decoder, person, practices, unit, rms_error_levels {mean, low, high, n},
    in_target, difference_levels]}.
    """
    import msgspec

    from tega.config.calibration.folder import CalibrationFolder
    from tega_practice.kept import FittsRecord, compare_kept, compare_tracked, kept_records

    home, named = CalibrationFolder(folder), decoders or ()
    from tega_learn.logs import PracticeRecord

    tracked = compare_tracked(kept_records(PracticeRecord, home, person), named)
    tests = kept_records(FittsRecord, home, person)
    found = compare_kept(tests, named) if tests or not tracked else []
    if as_json:
        echo_json({"fitts": msgspec.to_builtins(found), "tracking": msgspec.to_builtins(tracked)})
        return
    if found:
        _table(
            "Fitts tests; [95 % interval]",
            ("tests", "bits/s", "against first", "hit %", "path %", "overshoots"),
            [
                (
                    *(one.person, one.decoder, one.tests, one.throughput_bits_s, one.difference_bits_s),
                    f"{100 * one.completion:.0f}",
                    None if one.path_efficiency is None else f"{100 * one.path_efficiency:.0f}",
                    f"{one.overshoots:.1f}",
                )
                for one in found
            ],
        )
    if tracked:
        _table(
            "Practice: RMS error, levels of 1 to 5; [95 % interval]",
            ("practices", "error", "against first", "on the level %"),
            [
                (
                    *(one.person, one.decoder, one.practices, one.rms_error_levels, one.difference_levels),
                    f"{100 * one.in_target:.0f}",
                )
                for one in tracked
            ],
        )


def _table(title: str, numbers: tuple[str, ...], rows: list[tuple[object, ...]]) -> None:
    """Print rows that begin with a person (``None``: over people) and a decoder."""
    from rich.box import SIMPLE
    from rich.console import Console
    from rich.markup import escape
    from rich.table import Table

    table = Table(box=SIMPLE, title=title, title_justify="left")
    for name in ("person", "decoder"):
        table.add_column(name, no_wrap=True)
    for name in numbers:
        table.add_column(name, justify="right", no_wrap=True)
    for person, *others in rows:
        cells = ("–" if cell is None else escape(str(cell)) for cell in others)
        table.add_row(str(person or "over people"), *cells)
    Console(highlight=False, width=110).print(table)
