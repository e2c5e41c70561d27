"""Check the devices; print each problem with its cause and its fix: ``tega-teleop doctor``."""

from __future__ import annotations

import shutil
import textwrap
from pathlib import Path
from typing import TYPE_CHECKING

import click
from msgspec import to_builtins

from tega.runtime.words import printable
from tega.ui.cli.options import (
    PATH,
    echo_json,
    json_option,
    person_option,
    sets_option,
    with_origin,
    worn_by,
)

if TYPE_CHECKING:
    from tega.setup.doctor import Examination, Finding


_COLOURS = {"ok": "green", "warning": "yellow", "error": "red", "missing": "red"}
_STATUS_WIDTH = max(map(len, _COLOURS))
_WIDTHS = (60, 110)


@click.command(epilog="Example: tega-teleop doctor lab.toml")
@click.argument("config", type=PATH, metavar="[SETTINGS.toml]", required=False)
@person_option("Participant ID whose calibration is checked (default: calibration.person).")
@sets_option
@click.option(
    "--udev-rules", is_flag=True, help="Print the rules that let your user open the devices, and end."
)
@json_option
def doctor(
    *, config: Path | None, person: str | None, sets: tuple[str, ...], udev_rules: bool, as_json: bool
) -> None:
    """Check the devices; print each problem with its cause and its fix.

    Without SETTINGS.toml it searches for a DIGIT, an EMG amplifier, a vest and an Allegro Hand, within 10 s. With it,
    exactly the devices that it names are opened, read briefly and closed, within 30 s. The calibration is checked for
    these devices, this person and its age. No motor is switched on and no vest vibrates.

    Exit codes: 0 ready, 3 `run` would fail because of an error or a missing device, 1 invalid settings, 2 usage.

    With --json: {"format", "version", "settings", "ok", "exit_code", "findings"}, each finding with "check", "status"
    (ok, warning, error, missing), "finding", "why", "todo", "driver", "device", "measured".
    """
    if udev_rules:
        from tega.setup.doctor.lab_file import udev_rules as rules

        click.echo(rules(), nl=False)
        return
    examination = _examine(config, worn_by(person, sets), talk=not as_json)
    if as_json:
        code = examination.exit_code
        about = {"format": "tega-doctor", "version": 1, "settings": examination.settings or None}
        echo_json(
            {**about, "ok": code == 0, "exit_code": code, "findings": to_builtins(examination.findings)}
        )
    else:
        for line in reported(examination):
            click.echo(line)
    click.get_current_context().exit(examination.exit_code)


def _examine(config: Path | None, sets: tuple[str, ...], *, talk: bool) -> Examination:
    if config is None and not sets:
        from tega.setup.doctor import probe_all

        if talk:
            click.echo(
                "Looking for fingertip cameras, EMG amplifiers, vests and hands; this takes up to 10 s.\n",
                err=True,
            )
        return probe_all()
    from tega.config import load_config
    from tega.setup.doctor import examine

    loaded = load_config(config, sets=sets)
    if talk:
        click.echo(
            "Trying every device that the settings name; no motor moves, the vest stays silent.\n", err=True
        )
    name, given = ("--set", "SETTINGS.toml") if config is None else (config.name, str(config))
    return examine(loaded.config, name=name, settings=given)


def reported(examination: Examination) -> list[str]:
    """Return the lines for a person."""
    width = max(len(f.check) for f in examination.findings)
    lines: list[str] = []
    for finding in examination.findings:
        lines += [*_paragraph(finding, width), ""]
    return [*lines, *_summary(examination)]


def _paragraph(finding: Finding, width: int) -> list[str]:
    mark = click.style(
        f"{finding.status:<{_STATUS_WIDTH}}", fg=_COLOURS[finding.status], bold=finding.status != "ok"
    )
    head = f"{mark}  {finding.check:<{width}}  "
    margin = " " * (_STATUS_WIDTH + 2 + width + 2)
    sentence = finding.finding
    begins_with_name = finding.driver and sentence.startswith(finding.driver)
    if not begins_with_name and sentence.partition(" ")[0].isalpha():  # nor with the key of a setting
        sentence = sentence[:1].upper() + sentence[1:]
    wrapped = _wrapped(sentence, margin)
    lines = [head + wrapped[0].removeprefix(margin), *wrapped[1:]]
    if finding.why:
        label = "" if finding.status == "ok" else "why: "
        lines += _wrapped(label + finding.why, margin)
    for step in finding.todo:
        words, *commands = with_origin(step).split("\n")
        lines += _wrapped("→ " + words, margin, hang="  ")
        # A command is not broken: it is there to be copied.
        lines += [f"{margin}    {command}" for command in commands]
    return lines


def _wrapped(text: str, margin: str, hang: str = "") -> list[str]:
    return textwrap.wrap(
        printable(text),
        min(max(shutil.get_terminal_size((_WIDTHS[1], 24)).columns, _WIDTHS[0]), _WIDTHS[1]),
        initial_indent=margin,
        subsequent_indent=margin + hang,
        break_long_words=False,
        break_on_hyphens=False,
    ) or [margin]


def _summary(examination: Examination) -> list[str]:
    statuses = [finding.status for finding in examination.findings]
    n_bad, n_warnings = statuses.count("error") + statuses.count("missing"), statuses.count("warning")
    if n_bad:
        subject = f"Fix {n_bad} problem{'' if n_bad == 1 else 's'} before you start a session."
        if not examination.settings:
            return [
                subject,
                "Meanwhile, without any device: `tega-teleop demo` runs on a simulated bench, and",
                "`tega-teleop init --emulated` starts emulated devices to try `doctor` and `run` with.",
                "Once something is plugged in, `tega-teleop init` writes settings for it.",
            ]
        return [subject]
    ready = f"Ready, with {n_warnings} warning{'' if n_warnings == 1 else 's'}" if n_warnings else "Ready"
    then = ": `tega-teleop init` writes settings for these devices."
    if examination.settings:
        is_file = examination.settings.endswith(".toml")
        then = f": tega-teleop run {examination.settings}" if is_file else "."
    return [ready + then]
