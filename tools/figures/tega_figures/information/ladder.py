"""Run the ladder from an ideal vest and an ideal hand to the real ones, and print and draw what each step loses.

``python -m tega_figures.information.ladder run FILE`` goes on where it was stopped; ``table FILE`` and
``picture FILE PNG`` show what it holds. Everything is simulated.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final, NamedTuple

import click
import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.runtime.files.foreign_file import read_foreign
from tega_figures.information.bench import OFF
from tega_figures.information.compare import Paired, paired, power_text
from tega_figures.information.controls import N_LIFTS, SOFTEST
from tega_figures.information.sessions import OUTCOMES, BenchSession, bench_session, outcomes
from tega_sim.commanded import HandWay
from tega_sim.conditions import Condition

__all__ = ["RUNGS", "LadderSession", "Rung", "main", "read", "steps", "table_text"]


class Rung(NamedTuple):
    """One rung: which vest, and how the hand is told.

    Attributes:
        condition: The arm of the vest.
        hand: What the hand's level comes from.
        added: What is real from this rung on.
        mapping: Of the vest, where it is not the preset's.
    """

    condition: Condition
    hand: HandWay
    added: str
    mapping: str = ""

    @property
    def vest(self) -> str:
        """The arm, and the mapping where the condition's name does not say it."""
        return f"{self.condition} ({self.mapping})" if self.mapping else self.condition


RUNGS: Final = (
    Rung("ideal-vest", "aim", "nothing: true force, told on a skin that misses nothing"),
    Rung("true-force", "aim", "the vest's law and motors, and the person's own skin"),
    Rung("haptic", "aim", "the reading of pictures"),
    Rung("haptic", "drive", "the muscles: errors of aim, lags, slackening"),
    Rung("haptic", "decoder", "the EMG's noise and its decoder"),
)
"""From all that is ideal to all that is real; each is compared with no vest on the same way to the hand."""

STEPS: Final = "equal-steps"
STEP_RUNGS: Final = (
    Rung("true-steps", "aim", "the vest's motors, by equal steps of sensation, and the person's own skin"),
    Rung("haptic", "aim", "the reading of pictures", STEPS),
    Rung("haptic", "drive", "the muscles: errors of aim, lags, slackening", STEPS),
    Rung("haptic", "decoder", "the EMG's noise and its decoder", STEPS),
)
"""The same from the second rung on, with equal steps of sensation in the place of the printed law."""


class LadderSession(msgspec.Struct, frozen=True):
    """A session on a rung, or without a vest beside it.

    Attributes:
        hand: What the hand's level came from.
        session: The session.
        mapping: Of the vest, where it was not the preset's.
    """

    hand: HandWay
    session: BenchSession
    mapping: str = ""


@click.group(help=__doc__)
def main() -> None:
    """Group of the commands."""


@main.command()
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
@click.option("--people", default=8, show_default=True)
@click.option("--first", default=11000, show_default=True, help="Seed of the first person.")
@click.option("--object", "name", type=click.Choice(list(SOFTEST)), default="bag", show_default=True)
def run(file: Path, *, people: int, first: int, name: str) -> None:
    """Run the sessions that FILE does not hold yet, person by person: rules 3, out of sight, the softest wall."""
    known = (
        {(one.hand, one.session.seed, one.session.condition, one.mapping) for one in read(file)}
        if file.exists()
        else set()
    )
    off: list[tuple[Condition, HandWay, str]] = [
        ("non-haptic", hand, "") for hand in ("aim", "drive", "decoder")
    ]
    cells = off + [(rung.condition, rung.hand, rung.mapping) for rung in (*RUNGS, *STEP_RUNGS)]
    with file.open("ab") as out:
        for seed in range(first, first + people):
            for condition, hand, mapping in cells:
                if (hand, seed, condition, mapping) in known:
                    continue
                one = bench_session(
                    seed,
                    SOFTEST[name],
                    view="hidden",
                    condition=condition,
                    n_lifts=N_LIFTS,
                    rules=3,
                    hand=hand,
                    settings=(f"stages.mapping.name={mapping}",) if mapping else (),
                )
                out.write(msgspec.json.encode(LadderSession(hand, one, mapping)) + b"\n")
                out.flush()


@main.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
def table(file: Path) -> None:
    """Print FILE as Markdown."""
    click.echo(table_text(read(file)))


@main.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
def power(file: Path) -> None:
    """Print what FILE could have seen, and how many people its differences ask for; the rungs as five tests."""
    rows = {f"`{rung.vest}`, {rung.hand}": outcomes_of(read(file), rung) for rung, _ in steps(read(file))}
    click.echo(power_text(rows, OUTCOMES, confidence=1 - 0.05 / len(RUNGS)))


@main.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
@click.argument("png", type=click.Path(dir_okay=False, path_type=Path))
def picture(file: Path, png: Path) -> None:
    """Draw what the vest changes on each rung of FILE, with 95 % intervals over people, into PNG."""
    from matplotlib.figure import Figure

    found = steps(read(file))
    figure = Figure(figsize=(9, 0.5 * len(found) + 1.4), layout="constrained")
    shown = {"lost": "share of lifts lost", "harm": "share with deformation", "cost": "cost"}
    for axes, (what, label) in zip(figure.subplots(1, 3, sharey=True), shown.items(), strict=True):
        for place, (_, off) in enumerate(reversed(found)):
            axes.plot([off[what].low, off[what].high], [place, place], color="#1f5fbf", lw=2)
            axes.plot([off[what].mean], [place], "o", color="#1f5fbf")
        axes.axvline(0, color="0.6", lw=0.8)
        axes.set_xlabel(label)
        axes.set_yticks(range(len(found)), [f"{r.vest}, {r.hand}" for r, _ in reversed(found)])
    figure.suptitle(
        "With the vest less without, on each rung; mean and 95 % over people (simulated)",
        x=0.02,
        ha="left",
        fontsize=10,
    )
    figure.savefig(png, dpi=110)


def read(file: Path) -> list[LadderSession]:
    """Read sessions, one a line."""
    return [
        msgspec.json.decode(line, type=LadderSession) for line in read_foreign(file, most_mib=64).splitlines()
    ]


def steps(sessions: Sequence[LadderSession]) -> list[tuple[Rung, dict[str, Paired]]]:
    """Return what the vest changes on each rung that two people or more were on, within people."""
    found = []
    for rung in (*RUNGS, *STEP_RUNGS):
        told, off = outcomes_of(sessions, rung)
        if len(told) > 1:
            found.append((rung, paired(told, off, names=OUTCOMES)))
    return found


def outcomes_of(
    sessions: Sequence[LadderSession], rung: Rung
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return outcomes on a rung, and without a vest on the same way to the hand, of those who were on both."""
    by = {
        (one.hand, one.session.condition, one.mapping, one.session.seed): outcomes(one.session)
        for one in sessions
    }
    which = (rung.hand, rung.condition, rung.mapping)
    people = [seed for *cell, seed in by if tuple(cell) == which and (rung.hand, OFF, "", seed) in by]
    told, off = (
        np.array([by[rung.hand, condition, mapping, seed] for seed in people])
        for condition, mapping in ((rung.condition, rung.mapping), (OFF, ""))
    )
    return told, off


def table_text(sessions: Sequence[LadderSession]) -> str:
    """Return outcomes without a vest by the way to the hand, and each rung's differences from them, as Markdown."""
    lines = [f"| vest | hand by | real from here on | people | {' | '.join(OUTCOMES)} |"]
    lines.append("|---" * (len(OUTCOMES) + 4) + "|")
    for hand in ("aim", "drive", "decoder"):
        rows = [outcomes(one.session) for one in sessions if (one.hand, one.session.condition) == (hand, OFF)]
        if rows:
            cells = " | ".join(f"{mean:.2f}" for mean in np.mean(rows, axis=0))
            lines.append(f"| `{OFF}` | {hand} | – | {len(rows)} | {cells} |")
    for rung, off in steps(sessions):
        n = len(outcomes_of(sessions, rung)[0])
        cells = " | ".join(f"{d.mean:+.2f} ({d.low:+.2f} to {d.high:+.2f})" for d in off.values())
        lines.append(f"| `{rung.vest}` | {rung.hand} | {rung.added} | {n} | {cells} |")
    return "\n".join(lines)


if __name__ == "__main__":
    main()
