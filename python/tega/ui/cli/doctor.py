"""Check the devices and tell what is wrong, why, and what to do: ``tega-teleop doctor``."""

from __future__ import annotations

import json
import shutil
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

import click

from tega.ui.cli.options import json_option

if TYPE_CHECKING:
    from tega.setup.doctor import Examination, Finding


_MARKS = {
    "fine": ("ok", "green"),
    "doubt": ("look", "yellow"),
    "wrong": ("WRONG", "red"),
    "missing": ("none", "red"),
}
_WIDTHS = (60, 110)


@click.command(epilog="Example: tega-teleop doctor lab.toml")
@click.argument("config", type=click.Path(path_type=Path), metavar="[SETTINGS.toml]", required=False)
@click.option("--person", metavar="ID", help="Look at this person's calibration; else calibration.person.")
@click.option("--set", "sets", multiple=True, metavar="KEY=VALUE", help="Override a setting; repeatable.")
@click.option(
    "--udev-rules", is_flag=True, help="Print the rules that let your user open the devices, and end."
)
@json_option
def doctor(
    *,
    config: Path | None,
    person: str | None,
    sets: tuple[str, ...],
    udev_rules: bool,
    as_json: bool,
) -> None:
    """Check the devices; print what is wrong, why, and what to do.

    Without SETTINGS.toml a DIGIT, an EMG amplifier, a vest and an Allegro Hand are looked for, within 10 s. With it,
    exactly the devices it names are opened, read for a moment and closed, within 30 s, and the calibration is looked
    at: is there one for these devices and this person, and is it fresh. No motor is switched on and no vest vibrates.

    Exit codes: 0 all can be used, 3 something is missing or of no use as it is, 1 the settings are faulty, 2 usage.

    With --json: {"format", "version", "settings", "ok", "exit_code", "findings"}, each finding with "check", "status"
    (fine, doubt, wrong, missing), "finding", "why", "todo", "driver", "device", "measured".
    """
    from tega.ui.cli.options import echo_json

    if udev_rules:
        from tega.setup.doctor.udev import udev_rules as rules

        click.echo(rules(), nl=False)
        return
    if person is not None:
        sets = (*sets, f"calibration.person={json.dumps(person)}")
    examination = _examine(config, sets, talk=not as_json)
    if as_json:
        echo_json(as_table(examination))
    else:
        for line in told(examination):
            click.echo(line)
    click.get_current_context().exit(examination.exit_code)


def _examine(config: Path | None, sets: tuple[str, ...], *, talk: bool) -> Examination:
    if config is None and not sets:
        from tega.setup.doctor import look_around

        if talk:
            click.echo(
                "Looking for fingertip cameras, EMG amplifiers, vests and hands; this takes up to 10 s.\n",
                err=True,
            )
        return look_around()
    from tega.config import load_config
    from tega.setup.doctor import examine

    loaded = load_config(config, sets=sets)
    if talk:
        click.echo(
            "Trying every device that the settings name; no motor moves, the vest stays silent.\n", err=True
        )
    name, given = ("--set", "SETTINGS.toml") if config is None else (config.name, str(config))
    return examine(loaded.config, name=name, settings=given)


def as_table(examination: Examination) -> dict[str, object]:
    """Return what ``--json`` prints."""
    import msgspec

    code = examination.exit_code
    return {
        "format": "tega-doctor",
        "version": 1,
        "settings": examination.settings or None,
        "ok": code == 0,
        "exit_code": code,
        "findings": [{**msgspec.structs.asdict(f), "todo": list(f.todo)} for f in examination.findings],
    }


def told(examination: Examination) -> list[str]:
    """Return the lines for a person."""
    width = max(len(f.check) for f in examination.findings)
    lines: list[str] = []
    for finding in examination.findings:
        lines += [*_paragraph(finding, width), ""]
    return [*lines, *_summary(examination)]


def _paragraph(finding: Finding, width: int) -> list[str]:
    from tega.ui.cli.install_line import with_origin

    word, colour = _MARKS[finding.status]
    head = (
        f"{click.style(f'{word:<5}', fg=colour, bold=finding.status != 'fine')}  {finding.check:<{width}}  "
    )
    margin = " " * (5 + 2 + width + 2)
    sentence = finding.finding
    if not (finding.driver and sentence.startswith(finding.driver)):
        sentence = sentence[:1].upper() + sentence[1:]
    said = _wrapped(sentence, margin)
    lines = [head + said[0].removeprefix(margin), *said[1:]]
    if finding.why:
        label = "" if finding.status == "fine" else "why: "
        lines += _wrapped(label + finding.why, margin)
    for step in finding.todo:
        words, *commands = with_origin(step).split("\n")
        lines += _wrapped("→ " + words, margin, hang="  ")
        # A command is not broken: it is there to be copied.
        lines += [f"{margin}    {command}" for command in commands]
    return lines


def _wrapped(text: str, margin: str, hang: str = "") -> list[str]:
    return textwrap.wrap(
        text,
        min(max(shutil.get_terminal_size((_WIDTHS[1], 24)).columns, _WIDTHS[0]), _WIDTHS[1]),
        initial_indent=margin,
        subsequent_indent=margin + hang,
        break_long_words=False,
        break_on_hyphens=False,
    ) or [margin]


def _summary(examination: Examination) -> list[str]:
    n_bad, n_doubts = examination.count(("wrong", "missing")), examination.count(("doubt",))
    if n_bad:
        what = (
            f"{_number(n_bad)} {'thing needs' if n_bad == 1 else 'things need'} your hands before a session."
        )
        if not examination.settings:
            return [
                what,
                "Meanwhile, without any device: `tega-teleop demo` runs on a simulated bench, and",
                "`tega-teleop init --emulated` starts emulated devices to try `doctor` and `run` with.",
                "Once something is plugged in, `tega-teleop init` writes settings with what it finds.",
            ]
        return [what]
    if n_doubts:
        return [
            f"Everything can be used; {_number(n_doubts).lower()} {'thing' if n_doubts == 1 else 'things'} to look at."
        ]
    if examination.settings.endswith(".toml"):
        return [f"All is well: tega-teleop run {examination.settings}"]
    if examination.settings:
        return ["All is well."]
    return ["All is well: `tega-teleop init` writes settings with what was found."]


def _number(n: int) -> str:
    words = ("No", "One", "Two", "Three", "Four", "Five", "Six", "Seven", "Eight", "Nine", "Ten")
    return words[n] if n < len(words) else str(n)
