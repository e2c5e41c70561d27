"""Practise, test, and compare the results: ``practice``, ``emg fitts``, ``emg skill`` and ``vest learn``."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import click

from tega.ui.cli.options import (
    NAMES,
    PATH,
    FiniteRange,
    all_options,
    calibrated_person_option,
    echo_json,
    json_option,
    sets_option,
    worn_by,
)
from tega.ui.cli.page import view_options

_shown = partial(click.option, show_default=True)
_settings = click.argument("settings", type=PATH, metavar="SETTINGS.toml")
_seed = _shown("--seed", type=int, default=0, help="Seed of what is left to chance: curve or order.")
_yes = click.option("--yes", is_flag=True, help="Begin without waiting for Enter.")
_guided = all_options(_seed, _yes, sets_option, view_options, json_option)


@click.command(epilog="Example: tega-teleop practice lab.toml --person p01 --seconds 60")
@_settings
@calibrated_person_option
@_shown("--seconds", type=FiniteRange(10, 600), default=60.0, help="How long the practice lasts, seconds.")
@_guided
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
        names = ("in_target_percent", "rms_error_levels", "delay_s")
        figures = {name: getattr(record, name) for name in names}
        common = {"person": person, "decoder": record.decoder, "seconds": seconds, "seed": seed}
        echo_json({**common, **figures, "file": str(file)})


@click.command(
    epilog="Example: tega-teleop emg fitts lab.toml --person p01 --set stages.decoder.name=proportional"
)
@_settings
@calibrated_person_option
@_shown("--movements", type=click.IntRange(1, 100), default=6, help="Movements for each distance and width.")
@_shown("--dwell-s", type=FiniteRange(0.1, 5), default=1.0, help="Seconds to stay in a target.")
@_shown(
    "--timeout-s",
    type=FiniteRange(0.2, 60),
    default=10.0,
    help="Seconds after which the next target comes.",
)
@_guided
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
        times = {"dwell_s": dwell_s, "timeout_s": timeout_s}
        record, score, file = fitts_test(
            config, guide, movements=movements, **times, seed=seed, settings=str(settings)
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
    from tega_learn.logs import PracticeRecord
    from tega_practice.kept import FittsRecord, compare_kept, compare_tracked, kept_records

    home, named = CalibrationFolder(folder), decoders or ()
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
    from tega.ui.cli.report import figures_table, wide_console

    table = figures_table(["person", "decoder"], numbers, title)
    for person, *others in rows:
        table.add_row(str(person or "over people"), *("–" if cell is None else str(cell) for cell in others))
    wide_console().print(table)


@click.command(
    epilog="Example: tega-teleop vest learn lab.toml --person p01 --set stages.mapping.name=changes"
)
@_settings
@click.option("--person", required=True, metavar="ID", help="Who learns: their thresholds, dose and scores.")
@_shown("--questions", type=click.IntRange(1, 500), default=30, help="About how many questions the test has.")
@click.option("--test-only", is_flag=True, help="Go straight to the test: show and practise nothing first.")
@_seed
@sets_option
@json_option
def learn(
    *,
    settings: Path,
    person: str,
    questions: int,
    test_only: bool,
    seed: int,
    sets: tuple[str, ...],
    as_json: bool,
) -> None:
    """Learn what contacts feel like on the vest: shown, practised with a staircase, then tested.

    Needs the vest only. The score is kept with the person's calibration, and the vibration counts to their day. Ends
    where motors are warm or the day is used up: a weaker vest would teach something wrong.

    With --json: {"person", "mapping", "right_percent", "chance_percent", "difference_percent", "dose_s", "aspects":
    [{aspect, asked, right, chance}], "file"}.
    """
    from tega.config import load_config
    from tega.config.calibration.folder import CalibrationFolder
    from tega.errors import CalibrationError, ConfigError
    from tega.loop.worn_vest import dose_file, worn_vest
    from tega.runtime.guide import Undecided
    from tega.ui.cli.guide_page import guided
    from tega_practice.kept import VestSkillRecord, kept_records
    from tega_practice.vest_course import learn_vest

    config = load_config(settings, sets=worn_by(person, sets)).config
    if config.vest.driver is None:
        raise ConfigError("no vest: vest.driver is not set", "for example --set vest.driver=bhaptics-player")
    try:
        with (
            guided("TEGA vest lesson", yes=False, get_ready_s=1.0) as guide,
            worn_vest(config.vest, dose_file(config.calibration)) as vest,
        ):
            record, file = learn_vest(
                config, vest, guide, questions=questions, seed=seed, test_only=test_only
            )
    except Undecided:
        raise CalibrationError(
            "no answers: a lesson needs a person who answers", "run it in a terminal"
        ) from None
    for one in record.scores():
        guide.say(
            f"{one.aspect}: {100 * one.right:.0f} % right of {one.asked} (guessing: {100 * one.chance:.0f} %)"
        )
    guide.say(f"{record.mapping}: {record.right_percent:.0f} % right in all", tone="good")
    kept = CalibrationFolder(file.parents[3])
    earlier = [
        one
        for one in kept_records(VestSkillRecord, kept, person)
        if one.mapping == record.mapping and one.made < record.made
    ]
    if earlier:
        text = ", ".join(f"{one.right_percent:.0f} %" for one in earlier[-5:])
        guide.say(f"Earlier tests of {person} with {record.mapping}: {text}")
    if as_json:
        names = ("person", "mapping", "right_percent", "chance_percent", "difference_percent", "dose_s")
        reported = {name: getattr(record, name) for name in names}
        echo_json({**reported, "aspects": [one._asdict() for one in record.scores()], "file": str(file)})
