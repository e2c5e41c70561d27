"""Run the comparison of arms on fresh people, print its table and draw its picture.

``python -m tega_figures.information run FILE``, ``table FILE`` or ``picture FILE PNG``; of trials of the simulated
bench, ``condense TRIALS FILE`` and ``bench FILE``.
"""

from __future__ import annotations

from pathlib import Path

import click
import msgspec
import numpy as np
from numpy.typing import NDArray

from tega_figures.information.bench import ArmOutcomes, bench_arms, bench_table
from tega_figures.information.compare import (
    N_OBJECTS,
    N_TRIALS,
    OUTCOMES,
    agent_outcomes,
    null,
    paired,
    person_outcomes,
)
from tega_sim.operator import RulesVersion
from tega_sim.trials import read_results

RUNS: tuple[tuple[str, str], ...] = (
    ("rules 2", "off"),
    ("rules 2", "truth"),
    ("rules 2", "vest"),
    ("rules 2", "constant"),
    ("rules 2", "unrelated"),
    ("rules 2", "replayed"),
    ("rules 2", "inverted"),
    ("rules 1", "off"),
    ("rules 1", "truth"),
    ("agent", "nothing"),
    ("agent", "closure"),
    ("agent", "vest"),
    ("rules 1", "vest"),
    ("rules 1", "unrelated"),
)
"""Who under which arm, in the order in which they are run."""

GIVING_RUNS: tuple[tuple[str, str], ...] = (
    ("rules 3", "off"),
    ("rules 3", "truth"),
    ("rules 3", "vest"),
    ("rules 3", "constant"),
    ("rules 3", "unrelated"),
    ("rules 3", "replayed"),
    ("rules 2", "off"),
    ("rules 2", "truth"),
)
"""Likewise on objects whose walls give before they are harmed."""

_COLOURS = {"agent": "#555555", "rules 1": "#c8202f", "rules 2": "#1f5fbf", "rules 3": "#2a8a3c"}
_VERSIONS: dict[str, RulesVersion] = {"rules 1": 1, "rules 2": 2, "rules 3": 3}

_NOTHING = {**dict.fromkeys(_VERSIONS, "off"), "agent": "nothing"}


class Run(msgspec.Struct, frozen=True):
    """Outcomes of one actor under one arm, a row a person in the order of the outcomes."""

    who: str
    arm: str
    first_seed: int
    rows: list[list[float]]


@click.group(help=__doc__)
def main() -> None:
    """Group of the commands."""


@main.command()
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@click.option("--people", default=40, show_default=True)
@click.option("--first", default=1000, show_default=True, help="Seed of the first person.")
@click.option("--giving", is_flag=True, help="On objects whose walls give before they are harmed.")
def run(file: Path, people: int, first: int, *, giving: bool) -> None:
    """Run every arm that FILE does not hold yet, and write it there."""
    runs = _read(file) if file.is_file() else []
    seeds = range(first, first + people)
    for who, arm in GIVING_RUNS if giving else RUNS:
        if any((one.who, one.arm) == (who, arm) for one in runs):
            continue
        if who == "agent":
            rows = agent_outcomes(arm, seeds)  # type: ignore[arg-type]
        else:
            rows = person_outcomes(arm, seeds, version=_VERSIONS[who], giving=giving)  # type: ignore[arg-type]
        runs.append(Run(who, arm, first, np.round(rows, 6).tolist()))
        file.write_bytes(msgspec.json.format(msgspec.json.encode(runs), indent=0))
        click.echo(f"{who} {arm}: {rows.mean(axis=0).round(3)}")


@main.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
def table(file: Path) -> None:
    """Print the table of FILE as Markdown."""
    click.echo(table_text(file))


@main.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.argument("png", type=click.Path(dir_okay=False, path_type=Path))
def picture(file: Path, png: Path) -> None:
    """Draw the cost of each arm of FILE, less that of being told nothing, into PNG."""
    from matplotlib.figure import Figure

    runs = _read(file)
    figure = Figure(figsize=(8, 4.5), layout="constrained")
    axes = figure.subplots()
    shown = [one for one in runs if one.arm != _NOTHING[one.who]]
    for place, one in enumerate(reversed(shown)):
        cost = paired(np.array(one.rows), _nothing(runs, one.who))["cost"]
        colour = _COLOURS[one.who]
        axes.plot([cost.low, cost.high], [place, place], color=colour, lw=2)
        axes.plot([cost.mean], [place], "o", color=colour)
    axes.axvline(0, color="0.6", lw=0.8)
    axes.set_yticks(range(len(shown)), [f"{one.who}, {one.arm}" for one in reversed(shown)])
    axes.set_xlabel(
        "cost of a trial in slips, less that of being told nothing; mean and 95 % interval over people"
    )
    axes.set_title("What being told is worth on the one-dimensional plant (simulated)")
    figure.savefig(png, dpi=110)


@main.command()
@click.argument("trials", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
def condense(trials: Path, file: Path) -> None:
    """Take each person's outcomes under each arm from TRIALS, which `sim trials --out` wrote, into FILE."""
    arms = bench_arms(list(read_results(trials).values()))
    file.write_bytes(msgspec.json.format(msgspec.json.encode(arms), indent=0))


@main.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
def bench(file: Path) -> None:
    """Print the table of FILE, outcomes of people on the simulated bench, as Markdown."""
    click.echo(bench_table(msgspec.json.decode(file.read_bytes(), type=list[ArmOutcomes])))


def table_text(file: Path) -> str:
    """Return the outcomes told nothing, and every arm's differences from that, as Markdown."""
    runs = _read(file)
    lines = [
        " ".join(
            f"Version {version} of the rules."
            for who, version in _VERSIONS.items()
            if version > 1 and any(one.who == who for one in runs)
        )
        + f" {len(runs[0].rows)} people, "
        f"seeds from {runs[0].first_seed}, {N_OBJECTS} objects each, {N_TRIALS} lifts of each.",
        "",
        f"| who | told | {' | '.join(OUTCOMES)} | null |",
        "|---" * (len(OUTCOMES) + 3) + "|",
    ]
    for one in sorted(runs, key=lambda r: (r.who, r.arm != _NOTHING[r.who])):
        rows, nothing = np.array(one.rows), _nothing(runs, one.who)
        if one.arm == _NOTHING[one.who]:
            cells = [f"{mean:.2f}" for mean in rows.mean(axis=0)]
            verdict = ""
        else:
            found = paired(rows, nothing)
            cells = [f"{d.mean:+.3f} ({d.low:+.3f} to {d.high:+.3f})" for d in found.values()]
            verdict = "yes" if null(found) else "no"
        lines.append(f"| {one.who} | {one.arm} | {' | '.join(cells)} | {verdict} |")
    return "\n".join(lines)


def _read(file: Path) -> list[Run]:
    return msgspec.json.decode(file.read_bytes(), type=list[Run])


def _nothing(runs: list[Run], who: str) -> NDArray[np.float64]:
    return np.array(next(one.rows for one in runs if (one.who, one.arm) == (who, _NOTHING[who])))


if __name__ == "__main__":
    main()
