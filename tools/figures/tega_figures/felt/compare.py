"""Compare the vest's mappings on simulated people: the table and the picture of docs/evidence/mappings.md.

``python -m tega_figures.felt.compare --people 16 --picture docs/images/mappings.png``. Everything in it is simulated.
"""

from __future__ import annotations

import math
from pathlib import Path
from statistics import fmean
from typing import TYPE_CHECKING, NamedTuple

import click
import numpy as np

from tega.errors import MissingExtraError, TegaError
from tega.safety.motor_budget import MotorBudget
from tega_practice.interval import mean_interval
from tega_sim.operator.person import draw_person, stream

from .information import confusion_bits, information_bits, share_told, threshold_at
from .skin import REFRESH_S, BatchSkin
from .stimuli import COMPARED, TASKS, ComparedMapping, Stimulus, firmness, frames, grasps, holding, steps

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega_practice.interval import Interval
    from tega_sim.operator.sections import VestSection

__all__ = ["main"]

_TRIALS = {"all": 256}
_PRESENTATION_S = 1.5
_DIFFERENCES = (0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.4)
_BASES = (0.2, 0.5, 0.8)
_WORN_S = 600.0


class FeltInformation(NamedTuple):
    """What one person can tell of one mapping.

    Attributes:
        bits: By task, a presentation.
        shuffled: Of all at once with the labels shuffled, bits.
        thresholds: Difference of firmness told in 3 of 4 pairs, share of the maximum, at each base.
        dose_s: Seconds of full drive in a minute of grasps: of the most driven motor, and of all together.
        faded: Share by which the strongest motor is felt weaker after ten minutes of holding.
        bits_worn: Bits of firmness after those.
    """

    bits: dict[str, float]
    shuffled: float
    thresholds: tuple[float, ...]
    dose_s: tuple[float, float]
    faded: float
    bits_worn: float


def told_by(seed: int, displayed: ComparedMapping) -> FeltInformation:
    """Return what a simulated person can tell of a mapping."""
    person = draw_person(seed).vest
    rng = stream(seed, "felt", displayed.label)
    trials = {
        task: _presented(displayed, person, TASKS[task], _TRIALS.get(task, 150), rng=rng) for task in TASKS
    }
    bits = {task: information_bits(*some, rng) for task, some in trials.items()}
    percepts, stimuli = trials["all"]
    shuffled = information_bits(percepts, rng.permutation(stimuli), rng)
    worn = BatchSkin(person)
    worn.adapt(worn.moved(steps(frames(displayed, person, holding(_WORN_S)))))
    after = _presented(displayed, person, TASKS["firmness"], 150, rng=rng, adapted=worn.adapted)
    return FeltInformation(
        bits,
        shuffled,
        tuple(_threshold(displayed, person, base, rng) for base in _BASES),
        dose_of(displayed, person),
        1 - 1 / float(worn.adapted.max()),
        information_bits(*after, rng),
    )


def dose_of(displayed: ComparedMapping, person: VestSection) -> tuple[float, float]:
    """Return what a minute of grasps uses of the budget, seconds of full drive: the worst motor's, and the sum."""
    budget = MotorBudget()
    for n, frame in enumerate(frames(displayed, person, grasps(60.0))):
        budget.allow(round(n * REFRESH_S * 1e9), frame.x40())
    return float(budget.dose_s.max()), float(budget.dose_s.sum())


def _presented(
    displayed: ComparedMapping,
    person: VestSection,
    stimuli: tuple[Stimulus, ...],
    n_trials: int,
    *,
    rng: np.random.Generator,
    adapted: NDArray[np.float64] | None = None,
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    skin = BatchSkin(person, adapted)
    percepts = [skin.percepts(steps(frames(displayed, person, one)), n_trials, rng) for one in stimuli]
    return np.concatenate(percepts), np.repeat(np.arange(len(stimuli)), n_trials)


def _threshold(
    displayed: ComparedMapping, person: VestSection, base: float, rng: np.random.Generator
) -> float:
    skin = BatchSkin(person)

    def percepts(share: float) -> NDArray[np.float64]:
        return skin.percepts(steps(frames(displayed, person, firmness(share))), 300, rng)

    lower = percepts(base)
    differences = [d for d in _DIFFERENCES if base + d <= 1 + 1e-9]
    return threshold_at(differences, [share_told(lower, percepts(base + d), rng) for d in differences])


def ideal_bits(n_stimuli: int, n_trials: int = 200) -> float:
    """Return what the estimate reads of a channel without noise: log2 of the stimuli."""
    stimuli = np.repeat(np.arange(n_stimuli), n_trials)
    percepts = np.eye(n_stimuli)[stimuli]
    return information_bits(percepts, stimuli, np.random.default_rng(1))


def noisy_bits(apart_sd: float, n_trials: int = 20_000) -> tuple[float, float]:
    """Return estimate and theory for two stimuli in Gaussian noise that are so many deviations apart.

    Theory: named wrongly with p = Phi(-apart/2), they carry 1 - H2(p) bits.
    """
    rng = np.random.default_rng(2)
    stimuli = np.repeat([0, 1], n_trials)
    percepts = rng.standard_normal((2 * n_trials, 1)) + apart_sd * stimuli[:, None]
    p = 0.5 * math.erfc(apart_sd / 2 / math.sqrt(2))
    return information_bits(percepts, stimuli, rng), 1 + p * math.log2(p) + (1 - p) * math.log2(1 - p)


def _cell(values: list[float], digits: int = 2) -> str:
    if not all(map(math.isfinite, values)):
        n = sum(map(math.isfinite, values))
        return "not noticed" if not n else f"noticed by {n} of {len(values)}"
    one: Interval = mean_interval(values)
    if one.low is None or one.high is None:
        return f"{one.mean:z.{digits}f}"
    return f"{one.mean:z.{digits}f} [{one.low:z.{digits}f}, {one.high:z.{digits}f}]"


def table(found: dict[str, list[FeltInformation]]) -> str:
    """Return both tables as Markdown."""
    tasks = list(TASKS)
    lines = [
        "| mapping | " + " | ".join(tasks) + " | all, bits/s | all, shuffled |",
        "|---" * (len(tasks) + 3) + "|",
        "| *a channel without noise* | "
        + " | ".join(f"{ideal_bits(len(TASKS[task])):.2f}" for task in tasks)
        + f" | {ideal_bits(len(TASKS['all'])) / _PRESENTATION_S:.2f} | |",
    ]
    for label, people in found.items():
        cells = [_cell([one.bits[task] for one in people]) for task in tasks]
        cells.append(_cell([one.bits["all"] / _PRESENTATION_S for one in people]))
        cells.append(_cell([one.shuffled for one in people]))
        lines.append(f"| {label} | {' | '.join(cells)} |")
    lines += [
        "",
        "| mapping | " + " | ".join(f"difference noticed at {base:g}" for base in _BASES)
        + " | dose, worst motor | dose, all motors | felt weaker after 10 min | firmness then, bits |",
        "|---" * (len(_BASES) + 5) + "|",
    ]  # fmt: skip
    for label, people in found.items():
        cells = [_cell([one.thresholds[n] for one in people]) for n in range(len(_BASES))]
        cells += [_cell([one.dose_s[n] for one in people], 1) for n in range(2)]
        cells += [
            f"{100 * fmean(one.faded for one in people):.0f} %",
            _cell([one.bits_worn for one in people]),
        ]
        lines.append(f"| {label} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _draw(found: dict[str, list[FeltInformation]], file: Path) -> None:
    """Draw bits a second against dose, and the bits of each task."""
    try:
        from matplotlib.figure import Figure
    except ImportError as error:
        raise MissingExtraError("the picture needs matplotlib", "pip install 'tega[pictures]'") from error
    figure = Figure(figsize=(10, 4.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    for n, (label, people) in enumerate(found.items()):
        bits = mean_interval([one.bits["all"] / _PRESENTATION_S for one in people])
        half = 0.0 if bits.low is None else bits.mean - bits.low
        marker = "osD^vP*Xhd"[n % 10]
        dose_s = fmean(one.dose_s[0] for one in people)
        left.errorbar(dose_s, bits.mean, yerr=half, fmt=marker, capsize=3, label=label)
    left.set(
        xlabel="dose of the most driven motor, s of full drive a minute",
        ylabel="information, bits/s",
        xlim=(0, None),
        ylim=(0, None),
    )
    left.legend(fontsize=7)
    tasks = [task for task in TASKS if task != "all"]
    shares = [
        [fmean(one.bits[task] for one in people) / math.log2(len(TASKS[task])) for task in tasks]
        for people in found.values()
    ]
    image = right.imshow(np.clip(shares, 0, 1), vmin=0, vmax=1, cmap="viridis", aspect="auto")
    right.set_xticks(range(len(tasks)), tasks, rotation=30)
    right.set_yticks(range(len(found)), list(found), fontsize=7)
    figure.colorbar(image, ax=right, label="share of the task's bits that get through")
    n_people = len(next(iter(found.values())))
    figure.suptitle(f"Mappings on {n_people} simulated people (mean, 95 % interval over people)")
    figure.savefig(file, dpi=110)


@click.command(help=__doc__)
@click.option(
    "--people", type=click.IntRange(1, 200), default=16, show_default=True, help="How many bursts are played."
)
@click.option("--picture", type=click.Path(path_type=Path, dir_okay=False), help="Draw it there.")
def main(people: int, picture: Path | None) -> None:
    """Print the tables, and draw the picture where one is named."""
    found: dict[str, list[FeltInformation]] = {}
    for displayed in COMPARED:
        found[displayed.label] = [told_by(seed, displayed) for seed in range(people)]
        click.echo(
            f"{displayed.label}: {fmean(one.bits['all'] for one in found[displayed.label]):.2f} bits",
            err=True,
        )
    estimate, theory = noisy_bits(2.0)
    labels = np.repeat(np.arange(4), 500)
    click.echo(
        f"{people} simulated people. Two stimuli 2 deviations apart: {estimate:.3f} bits, theory {theory:.3f}; "
    )
    click.echo(
        f"named by chance: {confusion_bits(labels, np.random.default_rng(3).permutation(labels)):z.3f} bits.\n"
    )
    click.echo(table(found))
    if picture is not None:
        _draw(found, picture)


if __name__ == "__main__":
    try:
        main()
    except TegaError as error:
        raise SystemExit(f"error: {error}") from None
