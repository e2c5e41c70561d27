"""Measure what may be chosen, draw each subject, and write the tables of docs/evidence/pareto.md.

::

    python -m tega_figures.pareto.page                    # every subject
    python -m tega_figures.pareto.page jpeg-quality       # one
    python -m tega_figures.pareto.page --tables           # draws and writes what benches/pareto.json has
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Final

import click
import msgspec

from tega_figures.bench.machine import describe_machine
from tega_figures.bench.timing import single_threaded
from tega_figures.pareto.drawing import Choice, drawn, table
from tega_figures.pareto.emg_filter import emg_block, latency_and_smoothing
from tega_figures.pareto.jpeg import jpeg_quality
from tega_figures.pareto.reading import touch_reading

PROJECT: Final = Path(__file__).resolve().parents[4]
RESULTS: Final = PROJECT / "benches" / "pareto.json"
PAGE: Final = PROJECT / "docs" / "evidence" / "pareto.md"
PICTURES: Final = PROJECT / "docs" / "images"
SUBJECTS: Final[dict[str, tuple[str, Callable[..., Choice]]]] = {
    "touch-reading": ("pareto-touch-reading.svg", touch_reading),
    "emg-block": ("pareto-emg-block.svg", emg_block),
    "latency-and-smoothing": ("pareto-latency-and-smoothing.svg", latency_and_smoothing),
    "jpeg-quality": ("pareto-jpeg-quality.svg", jpeg_quality),
}
"""Subjects by name: the picture, and what measures."""


class Choices(msgspec.Struct):
    """All subjects, by name, and where each was measured."""

    machines: dict[str, str]
    choices: dict[str, Choice]


def kept() -> Choices:
    """Return what is committed."""
    if not RESULTS.exists():
        return Choices({}, {})
    return msgspec.json.decode(RESULTS.read_bytes(), type=Choices)


def part(name: str, measured: Choices) -> str:
    """Return what the page says of one subject."""
    choice = measured.choices[name]
    return "\n".join(
        [
            f"Set by {choice.setting}. {choice.how}",
            "",
            f"![{choice.title}: {choice.cost} against {choice.error}](../images/{SUBJECTS[name][0]})",
            "",
            table(choice),
            "",
            f"**Why the default.** {choice.why}",
            "",
            f"{measured.machines[name]}; `python -m tega_figures.pareto.page {name}`.",
        ]
    )


def page(text: str, measured: Choices) -> str:
    """Return the page with its made parts anew."""
    for name in measured.choices:
        head, found, rest = text.partition(f"<!-- made: {name} -->\n")
        _, end, after = rest.partition("\n<!-- end -->")
        if not found or not end:
            raise SystemExit(f"{PAGE.name} has no part {name!r}")
        text = f"{head}{found}\n{part(name, measured)}\n{end}{after}"
    return text


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.argument("subjects", nargs=-1, type=click.Choice(list(SUBJECTS)))
@click.option("--budget", default=3.0, show_default=True, help="Seconds that timing may take for a subject.")
@click.option("--tables", is_flag=True, help="Draw what is committed; measure nothing.")
def main(subjects: tuple[str, ...], *, budget: float, tables: bool) -> None:
    """Measure, draw, and write the page."""
    measured = kept()
    names = list(subjects or SUBJECTS)
    if not tables:
        for name in names:
            click.echo(name, err=True)
            machine = describe_machine()
            with single_threaded():
                measured.choices[name] = SUBJECTS[name][1](budget_s=budget)
            load = f", load {machine.load_per_core:.1f} a core" if machine.load_per_core is not None else ""
            measured.machines[name] = (
                f"Measured on {machine.cpu}, {machine.instruction_set}{load}; ratios matter, not microseconds"
            )
        measured.choices = {name: measured.choices[name] for name in SUBJECTS if name in measured.choices}
        RESULTS.write_bytes(msgspec.json.format(msgspec.json.encode(measured), indent=1) + b"\n")
    for name in names:
        drawn(measured.choices[name]).savefig(PICTURES / SUBJECTS[name][0], metadata={"Date": None})
    PAGE.write_text(page(PAGE.read_text(encoding="utf-8"), measured), encoding="utf-8")


if __name__ == "__main__":
    main()
