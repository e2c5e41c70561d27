"""Keep the steps of an acceptance, and write its report as JSON and as text."""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from datetime import datetime
from pathlib import Path
from typing import Final, Literal

import click
import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.runtime.files.whole_file import write_whole

AcceptanceStatus = Literal["passed", "look", "failed", "skipped"]
"""``look``: usable, but a person should check it."""

STEPS: Final = ("identity", "rate", "latency", "limits", "least", "stop")
"""Steps in their order; ``least`` is one motion or pulse at the least strength, or one least touch of a sensor."""

SEND_BACK: Final = (
    "both files of this report",
    "the words that stand on the device, and its firmware's version",
    "what differed from the device's page in the documentation, step by step",
    "whatever moved, vibrated or stayed on when it should not have",
)

_TITLES: Final = {
    "identity": "Who it is",
    "rate": "How fast",
    "latency": "How late",
    "limits": "Its limits",
    "least": "The least motion, pulse or touch",
    "stop": "Its stop",
}
_WIDTH: Final = 100


class AcceptanceStep(msgspec.Struct, frozen=True, kw_only=True):
    """Step of an acceptance.

    Attributes:
        name: One of :data:`STEPS`.
        said: Finding, one or two sentences.
        todo: What to do about it; ``""`` for nothing.
        measured: Numbers, by a name that ends with the unit.
        answers: The person's, by question.
    """

    name: str
    status: AcceptanceStatus
    said: str
    todo: str = ""
    measured: dict[str, float] = {}
    answers: dict[str, str] = {}


class AcceptanceReport(msgspec.Struct, frozen=True, kw_only=True):
    """Report of a device's acceptance.

    Attributes:
        made: When it began, UTC.
        tega: Version of this program.
        system: Operating system, processor and Python.
        check: Part of the settings, such as ``vest``.
        device: Its name; a serial number if it has one.
        options: The driver's options of the settings that are numbers or yes and no; no path, name or key.
        answered: Whether a person answered; otherwise nothing was seen or felt.
        send_back: What to send to the project.
    """

    format: Literal["tega-acceptance"] = "tega-acceptance"
    version: int = 1
    made: datetime
    tega: str
    system: str
    check: str
    kind: str
    driver: str
    device: str
    options: dict[str, str]
    answered: bool
    steps: tuple[AcceptanceStep, ...]
    send_back: tuple[str, ...] = SEND_BACK

    @property
    def passed(self) -> bool:
        """Whether no step failed."""
        return all(step.status != "failed" for step in self.steps)


def spread_ms(name: str, values_ms: Sequence[float] | NDArray[np.float64]) -> dict[str, float]:
    """Return median, 95th percentile and maximum as measurements such as ``age_p50_ms``; none without a value."""
    if not len(values_ms):
        return {}
    return {f"{name}_p{p}_ms": round(float(np.percentile(values_ms, p)), 2) for p in (50, 95, 100)}


class AcceptanceGuide:
    """Person at the device; with ``yes`` nobody: everything is agreed to, and nothing is seen or felt."""

    def __init__(self, *, yes: bool = False) -> None:
        self._yes = yes

    def say(self, text: str) -> None:
        """Show a message."""
        click.echo(text, err=True)

    def confirm(self, text: str) -> bool:
        """Ask whether something may be done; nothing moves without a yes."""
        if self._yes:
            self.say(f"{text} yes (--yes)")
            return True
        return click.confirm(text, default=False, err=True)

    def ask(self, text: str) -> str:
        """Ask for a sight or sensation; ``""`` without an answer."""
        if self._yes:
            self.say(f"{text} (not asked)")
            return ""
        answer: str = click.prompt(text, default="", show_default=False, prompt_suffix=" ", err=True)
        return answer.strip()


def report_text(report: AcceptanceReport) -> str:
    """Return a report as text for a person."""
    who = "a person answered" if report.answered else "no person was asked, so nothing was seen or felt"
    lines = [
        f"Acceptance of {report.check}: {report.driver} {report.device}",
        f"{report.made:%Y-%m-%d %H:%M} UTC, TEGA {report.tega}, {report.system}; {who}",
        f"Options of the settings: {', '.join(f'{k} = {v}' for k, v in report.options.items()) or 'none'}",
        "",
    ]
    for step in report.steps:
        lines.append(f"{step.status:<8}{_TITLES[step.name]}")
        lines += _wrapped(step.said)
        if step.measured:
            lines += _wrapped(", ".join(f"{name} {value:g}" for name, value in step.measured.items()))
        for question, answer in step.answers.items():
            lines += _wrapped(f"{question} {answer or '(no answer)'}")
        if step.todo:
            lines += _wrapped(f"→ {step.todo}")
        lines.append("")
    lines.append("Passed." if report.passed else "Not passed.")
    lines += ["", "To send back:", *(f"- {subject}" for subject in report.send_back), ""]
    return "\n".join(lines)


def _wrapped(text: str) -> list[str]:
    margin = " " * 8
    return textwrap.wrap(text, _WIDTH, initial_indent=margin, subsequent_indent=margin)


def write_report(report: AcceptanceReport, folder: Path) -> tuple[Path, Path]:
    """Write a report into a folder, which is made if need be; return the JSON file and the text file."""
    name = f"{report.check.replace('.', '-')}-{report.made:%Y%m%d-%H%M%S}"
    data, text = folder / f"{name}.json", folder / f"{name}.txt"
    encoded = msgspec.json.format(
        msgspec.json.encode({**msgspec.structs.asdict(report), "passed": report.passed})
    )
    write_whole(data, encoded + b"\n")
    write_whole(text, report_text(report))
    return data, text
