"""Ask the person at a device, and print its acceptance: ``tega-teleop doctor --acceptance DEVICE``."""

from __future__ import annotations

import sys
from pathlib import Path

import click

from tega.ui.cli.options import echo_json

_FAILED = 3


class _Asked:
    """The person at the terminal."""

    def say(self, text: str) -> None:
        click.echo(text, err=True)

    def confirm(self, text: str) -> bool:
        return click.confirm(text, default=False, err=True)

    def ask(self, text: str) -> str:
        answer: str = click.prompt(text, default="", show_default=False, prompt_suffix=" ", err=True)
        return answer.strip()


class _Unasked:
    """Nobody: everything is done, and nothing is seen or felt."""

    def say(self, text: str) -> None:
        click.echo(text, err=True)

    def confirm(self, text: str) -> bool:
        click.echo(f"{text} yes (--yes)", err=True)
        return True

    def ask(self, text: str) -> str:
        click.echo(f"{text} (not asked)", err=True)
        return ""


def accept(
    config: Path | None, sets: tuple[str, ...], name: str, *, out: Path, yes: bool, as_json: bool
) -> int:
    """Run the acceptance of one device of the settings, write its report, and return the exit code.

    Raises:
        ConfigError: The settings name no such device.
        click.UsageError: There is nobody to ask.
    """
    from tega.config import load_config
    from tega_bench.acceptance import accept_device, acceptance_case, report_text, write_report

    if not yes and not sys.stdin.isatty():
        raise click.UsageError(
            "an acceptance asks a person: run it in a terminal, or with --yes on emulated devices"
        )
    loaded = load_config(config, sets=sets).config
    case = acceptance_case(loaded, name)
    report = accept_device(loaded, case, _Unasked() if yes else _Asked(), answered=not yes)
    data, text = write_report(report, out)
    if as_json:
        steps = [{"name": s.name, "status": s.status, "measured": s.measured} for s in report.steps]
        echo_json({"report": str(data), "text": str(text), "passed": report.passed, "steps": steps})
    else:
        click.echo(report_text(report))
        click.echo(f"Wrote {data} and {text}: send both back, they make the table of tried devices.")
    return 0 if report.passed else _FAILED
