"""Take the arms of a study in silico out of its folder, and test, print and draw what each changes within people.

``python -m tega_figures.information.arms condense STUDY FILE`` keeps the outcomes of every session that ended, one
person and arm a line; ``table FILE...``, ``power FILE`` and ``picture PNG FILE...`` show them. Everything is simulated.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Final

import click
import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.runtime.files.foreign_file import read_foreign
from tega_figures.information.bench import OFF
from tega_figures.information.compare import Paired, paired, power_text
from tega_figures.information.controls import read
from tega_figures.information.sessions import OUTCOMES, BenchSession, lift_outcome, outcomes
from tega_sim.conditions import Condition
from tega_sim.plan import TrialResult
from tega_study.journal import events_path
from tega_study.plan import read_plan
from tega_study.silico.session import RESULTS

__all__ = ["CONTROLS", "N_TESTS", "TESTED", "by_person", "condensed", "holm", "main", "table_text"]

TESTED: Final[tuple[Condition, ...]] = ("haptic", "true-steps", "reflex", "haptic-reflex")
"""Arms that are tested, each in the first study that has it; the four arms are :data:`OFF`, vest, reflex, both."""

TESTED_OUTCOMES: Final = ("lost", "cost")

N_TESTS: Final = len(TESTED) * len(TESTED_OUTCOMES)
"""Tests that are corrected together, by Holm's method."""

CONTROLS: Final[tuple[Condition, ...]] = ("oracle", "true-reflex")
"""Arms that have to say yes: each loses fewer lifts, one test of its own."""

_EFFECTS: Final[dict[str, dict[Condition, float]]] = {
    "the vest": {"haptic": 0.5, "haptic-reflex": 0.5, OFF: -0.5, "reflex": -0.5},
    "the reflex": {"reflex": 0.5, "haptic-reflex": 0.5, OFF: -0.5, "haptic": -0.5},
    "both beyond each": {"haptic-reflex": 1.0, OFF: 1.0, "haptic": -1.0, "reflex": -1.0},
}
"""Effects of the two factors, as weights of the arms."""


@click.group(help=__doc__)
def main() -> None:
    """Group of the commands."""


@main.command()
@click.argument("study", type=click.Path(exists=True, file_okay=False, path_type=Path))
@click.argument("file", type=click.Path(dir_okay=False, path_type=Path))
def condense(study: Path, file: Path) -> None:
    """Keep the outcomes of STUDY's ended sessions in FILE."""
    file.write_bytes(b"".join(msgspec.json.encode(one) + b"\n" for one in condensed(study)))


@main.command()
@click.argument(
    "files", nargs=-1, required=True, type=click.Path(exists=True, dir_okay=False, path_type=Path)
)
def table(files: tuple[Path, ...]) -> None:
    """Print FILES, a study each, as Markdown: arms, effects of vest and reflex, and the planned tests of them all."""
    click.echo(table_text([read(file) for file in files]))


@main.command()
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
def power(file: Path) -> None:
    """Print what FILE could have seen, and how many people its differences ask for; by Bonferroni over the tests."""
    arms = by_person(read(file))
    rows = {f"`{arm}`": (rows, arms[OFF]) for arm, rows in arms.items() if arm != OFF}
    click.echo(power_text(rows, OUTCOMES, confidence=1 - 0.05 / N_TESTS))


@main.command()
@click.argument("png", type=click.Path(dir_okay=False, path_type=Path))
@click.argument(
    "files", nargs=-1, required=True, type=click.Path(exists=True, dir_okay=False, path_type=Path)
)
def picture(png: Path, files: tuple[Path, ...]) -> None:
    """Draw into PNG what each arm of FILES, a study each, changes, with 95 % intervals over people."""
    from matplotlib.figure import Figure

    labels = {
        "lost": "share of lifts lost",
        "slid": "way slid a lift, mm",
        "harm": "share with deformation",
        "effort": "level held, share of full",
        "cost": "cost, in slips",
    }
    rows = []
    for file in files:
        arms = by_person(read(file))
        rows += [
            (f"{arm}, {len(arms[OFF])} people", arm, paired(told, arms[OFF], names=OUTCOMES))
            for arm, told in arms.items()
            if arm != OFF
        ]
    figure = Figure(figsize=(12, 0.42 * len(rows) + 1.5), layout="constrained")
    for axes, (what, label) in zip(figure.subplots(1, len(labels), sharey=True), labels.items(), strict=True):
        for place, (_, arm, found) in enumerate(reversed(rows)):
            one, colour = found[what], "#1f5fbf" if arm in TESTED else "#777777"
            axes.plot([one.low, one.high], [place, place], color=colour, lw=2)
            axes.plot([one.mean], [place], "o", color=colour)
        axes.axvline(0, color="0.6", lw=0.8)
        axes.set_xlabel(label)
        axes.set_yticks(range(len(rows)), [name for name, _, _ in reversed(rows)])
    figure.suptitle(
        "Each arm less neither vest nor reflex; mean and 95 % interval over people (simulated)",
        x=0.02,
        ha="left",
        fontsize=10,
    )
    figure.savefig(png, dpi=110)


def condensed(study: Path) -> list[BenchSession]:
    """Return the outcomes of a study's ended sessions, person by person, a session an arm.

    Args:
        study: Folder of a study in silico of one object, run with ``fresh``.
    """
    plan = read_plan(study)
    (name,) = plan.settings.objects
    sessions = []
    for person in plan.participants:
        file = events_path(study, person).with_name(RESULTS)
        if not file.is_file():
            continue
        lifts = [
            msgspec.json.decode(line, type=TrialResult)
            for line in read_foreign(file, most_mib=64).splitlines()
        ]
        for condition in dict.fromkeys(one.condition for one in lifts):
            mine = [one for one in lifts if one.condition == condition]
            first = mine[0]
            sessions.append(
                BenchSession(
                    seed=first.seed,
                    object=name,
                    view=first.view,
                    condition=condition,
                    rules=first.rules,
                    people=first.person,
                    lifts=[lift_outcome(one) for one in mine],
                )
            )
    return sessions


def by_person(sessions: Sequence[BenchSession]) -> dict[Condition, NDArray[np.float64]]:
    """Return each arm's outcomes, a row a person, of the people who were under every arm; no vest comes first."""
    there = {one.condition for one in sessions}
    known = (OFF, *TESTED, *CONTROLS)
    arms: dict[Condition, dict[int, list[float]]] = {
        arm: {} for arm in (*known, *sorted(there.difference(known))) if arm in there
    }
    for one in sessions:
        arms[one.condition][one.seed] = outcomes(one)
    people = sorted(set.intersection(*(set(rows) for rows in arms.values())))
    return {arm: np.array([rows[seed] for seed in people]) for arm, rows in arms.items()}


def holm(p_values: Sequence[float]) -> list[float]:
    """Return p-values corrected together by Holm's method (1979), in their order.

    Example:
        >>> holm([0.01, 0.04, 0.03])
        [0.03, 0.06, 0.06]
    """
    corrected, least = [0.0] * len(p_values), 0.0
    for rank, place in enumerate(sorted(range(len(p_values)), key=p_values.__getitem__)):
        least = max(least, min(p_values[place] * (len(p_values) - rank), 1.0))
        corrected[place] = round(least, 12)
    return corrected


def table_text(studies: Sequence[Sequence[BenchSession]]) -> str:
    """Return each study's arms as Markdown, with effects of vest and reflex, and the planned tests of all studies."""
    lines, tests, tested = [], list[tuple[Condition, str, float, float]](), set[Condition]()
    for sessions in studies:
        arms = by_person(sessions)
        off = arms[OFF]
        lines += [f"| arm | people | {' | '.join(OUTCOMES)} |", "|---" * (len(OUTCOMES) + 2) + "|"]
        lines.append(f"| `{OFF}` | {len(off)} | {' | '.join(f'{mean:.3f}' for mean in off.mean(axis=0))} |")
        for arm, rows in arms.items():
            if arm != OFF:
                lines.append(f"| `{arm}` | {len(rows)} | {_cells(paired(rows, off, names=OUTCOMES))} |")
        for name, weights in _EFFECTS.items():
            if weights.keys() <= arms.keys():
                effect = np.sum([weight * arms[arm] for arm, weight in weights.items()], axis=0)
                cells = _cells(paired(effect, 0 * off, names=OUTCOMES))
                lines.append(f"| {name} | {len(off)} | {cells} |")
        lines.append("")
        new = [arm for arm in (*TESTED, *CONTROLS) if arm in arms and arm not in tested]
        tested.update(new)
        for arm in new:
            for what in TESTED_OUTCOMES if arm not in CONTROLS else ("lost",):
                difference = (arms[arm] - off)[:, OUTCOMES.index(what)]
                tests.append((arm, what, float(difference.mean()), _p(difference)))
    planned = [test for test in tests if test[0] not in CONTROLS]
    lines += ["| test | difference | p | p by Holm |", "|---|---|---|---|"]
    for (arm, what, mean, p), corrected in zip(planned, holm([test[3] for test in planned]), strict=True):
        lines.append(f"| `{arm}`, {what} | {mean:+.3f} | {p:.3f} | {corrected:.3f} |")
    for arm, what, mean, p in tests:
        if arm in CONTROLS:
            lines.append(f"| control: `{arm}`, {what} | {mean:+.3f} | {p:.3f} | |")
    return "\n".join(lines)


def _cells(found: dict[str, Paired]) -> str:
    return " | ".join(f"{d.mean:+.3f} ({d.low:+.3f} to {d.high:+.3f})" for d in found.values())


def _p(difference: NDArray[np.float64]) -> float:
    """Return Student's two-sided p of differences within people; 1 where nobody differs."""
    from scipy.stats import ttest_1samp

    if not difference.any():
        return 1.0
    return float(ttest_1samp(difference, 0.0).pvalue) if np.ptp(difference) > 0 else 0.0


if __name__ == "__main__":
    main()
