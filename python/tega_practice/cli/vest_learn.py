"""Teach a person to read a mapping on the vest, and test them: ``tega-teleop vest learn``."""

from __future__ import annotations

from pathlib import Path

import click

from tega.ui.cli.options import echo_json, json_option, sets_option, worn_by


@click.command(
    epilog="Example: tega-teleop vest learn lab.toml --person p01 --set stages.mapping.name=changes"
)
@click.argument("settings", type=click.Path(path_type=Path), metavar="SETTINGS.toml")
@click.option("--person", required=True, metavar="ID", help="Who learns: their thresholds, dose and scores.")
@click.option(
    "--questions",
    type=click.IntRange(1, 500),
    default=30,
    show_default=True,
    help="About how many questions the test has.",
)
@click.option("--test-only", is_flag=True, help="Go straight to the test: show and practise nothing first.")
@click.option("--seed", type=int, default=0, show_default=True, help="Seed of the order.")
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
    from tega_practice.kept import kept_records
    from tega_practice.vest_course import learn_vest
    from tega_practice.vest_kept import VestSkillRecord

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
        reported = {
            name: getattr(record, name) for name in ("person", "mapping", "right_percent", "chance_percent")
        }
        reported |= {"difference_percent": record.difference_percent, "dose_s": record.dose_s}
        echo_json({**reported, "aspects": [one._asdict() for one in record.scores()], "file": str(file)})
