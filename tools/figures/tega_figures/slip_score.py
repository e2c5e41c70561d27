"""Scores the slips that were told of trials against their truth, with intervals over people, and what truth would tell.

The bar for slips by touch alone: F1 of 0.85, half of them told within 60 ms, at most 0.5 false ones a minute.
:func:`true_shear` has a detector told the gels' true shear where the reading's is told else, :func:`by_speed` the
object's true speed: what is missed then is not for the reading to find.

``python -m tega_figures.slip_score FILE`` prints the scores of the trials that ``check_events --keep FILE`` kept.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import click
import msgspec
import numpy as np

from tega.runtime.files.foreign_file import read_foreign
from tega.stages.events import ShearFrame
from tega_figures.slip_rule import TOLERANCE_S
from tega_sim.seams import Shear
from tega_study.score import match_events

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega_figures.check_events import KeptTrial

__all__ = [
    "HEAD",
    "ScoredTrial",
    "SlipsTold",
    "by_speed",
    "read_scored",
    "score_row",
    "slid_mm",
    "true_shear",
]

DRAWS: Final = 1500
"""How often people are drawn anew for an interval of 95 %."""

SUSTAINED_S: Final = 0.03
"""For so long a slide has to last that is told by its true speed: the truth's own rule."""

IDLE_MM: Final = 1.0
"""An object that slides less than this within the tolerance of what was told did not slide at all."""

LOWERED_S: Final = 0.2
LOWERED_M: Final = 0.003
"""A hand that has come down so far in so long is being lowered."""

HEAD: Final = (
    "| slips told by | trials | slips | told | right | F1 (95 %) | false a minute (95 %) | of these, nothing slid "
    "| median delay, s (95 %) |\n|---|---|---|---|---|---|---|---|---|"
)


class SlipsTold(NamedTuple):
    """Slips of a trial, true ones and told ones.

    Attributes:
        person: Whose.
        minutes: Length of the trial.
        truth_s: When slips began, seconds.
        told_s: When slips were told, seconds.
        slid_mm: How far the object slid within the tolerance of each told one, millimetres.
    """

    person: int
    minutes: float
    truth_s: Sequence[float]
    told_s: Sequence[float]
    slid_mm: Sequence[float] = ()


class ScoredTrial(msgspec.Struct, frozen=True):
    """A line of a file of scored trials.

    Attributes:
        object: What was lifted.
        shear: Of the gels.
        ways: Slips by the way in which they were told.
    """

    object: str
    shear: Shear
    ways: dict[str, SlipsTold]


class _Counted(NamedTuple):
    n_true: int
    n_told: int
    n_idle: int
    minutes: float
    late_s: list[float]


def score_row(name: str, trials: Sequence[SlipsTold]) -> str:
    """Return a line of the table under :data:`HEAD`.

    Args:
        name: What told the slips.
        trials: What it told; an interval draws their people anew, :data:`DRAWS` times, by one seed.
    """
    by: dict[int, list[_Counted]] = {}
    for one in trials:
        pairs = match_events(list(one.truth_s), list(one.told_s), tolerance_s=TOLERANCE_S)
        late_s = [one.told_s[j] - one.truth_s[i] for i, j in pairs]
        false = set(range(len(one.told_s))) - {j for _, j in pairs}
        n_idle = sum(one.slid_mm[j] < IDLE_MM for j in false)
        by.setdefault(one.person, []).append(
            _Counted(len(one.truth_s), len(one.told_s), n_idle, one.minutes, late_s)
        )
    people = list(by.values())
    draws = np.random.default_rng(1).integers(len(people), size=(DRAWS, len(people)))
    drawn = [[one for k in draw for one in people[k]] for draw in draws.tolist()]
    every = [one for person in people for one in person]
    right = sum(len(one.late_s) for one in every)
    n_true, n_told = sum(one.n_true for one in every), sum(one.n_told for one in every)
    cells = " | ".join(_with_interval(of, every, drawn) for of in (_f1, _false, _idle, _late))
    return f"| {name} | {len(every)} | {n_true} | {n_told} | {right} | {cells} |"


def _with_interval(
    of: Callable[[Sequence[_Counted]], float], every: Sequence[_Counted], drawn: Sequence[Sequence[_Counted]]
) -> str:
    found: NDArray[np.float64] = np.array([of(one) for one in drawn])
    if np.isnan(found).all():
        return "–"
    low, high = np.nanquantile(found, [0.025, 0.975])
    return f"{of(every):.2f} ({low:.2f} to {high:.2f})"


def _f1(trials: Sequence[_Counted]) -> float:
    events = sum(one.n_true + one.n_told for one in trials)
    return 2 * sum(len(one.late_s) for one in trials) / events if events else float("nan")


def _false(trials: Sequence[_Counted]) -> float:
    return sum(one.n_told - len(one.late_s) for one in trials) / sum(one.minutes for one in trials)


def _idle(trials: Sequence[_Counted]) -> float:
    return sum(one.n_idle for one in trials) / sum(one.minutes for one in trials)


def slid_mm(speed: Sequence[tuple[float, float]], t_s: float) -> float:
    """Return how far an object slid within the tolerance of a time, millimetres."""
    near = [(at_s, v) for at_s, v in speed if abs(at_s - t_s) <= TOLERANCE_S]
    return 1e3 * sum((b[0] - a[0]) * max(a[1], 0.0) for a, b in itertools.pairwise(near))


def _late(trials: Sequence[_Counted]) -> float:
    late_s = [late for one in trials for late in one.late_s]
    return float(np.median(late_s)) if late_s else float("nan")


def true_shear(kept: KeptTrial) -> KeptTrial:
    """Return a trial whose fingertips are told their gels' true shear: mean pull, share that has slid, and no doubt."""
    shear = [(t_s, finger, ShearFrame(*true.mean_mm, true.slid, 0.0, 1.0)) for t_s, finger, true in kept.gels]
    return kept._replace(shear=shear)


def by_speed(kept: KeptTrial, least_m_s: float) -> list[float]:
    """Return when slips are told by the object's true speed off the table, with the half second's rest of the detector.

    Nothing is told while the hand is lowered: the truth counts no slip of what is being put down.

    Args:
        kept: The trial.
        least_m_s: Speed that is told as soon as it has lasted for :data:`SUSTAINED_S`, metres a second.
    """
    told: list[float] = []
    height_t_s, height_m = np.array([(row.t_s, row.height_m or 0.0) for row in kept.hand]).T
    since_s: float | None = None
    free_s = -1.0
    for t_s, speed in kept.speed:
        if speed < least_m_s:
            since_s = None
            continue
        since_s = t_s if since_s is None else since_s
        if t_s - since_s >= SUSTAINED_S - 1e-9:
            before_m, now_m = np.interp([t_s - LOWERED_S, t_s], height_t_s, height_m)
            if t_s >= free_s and now_m > before_m - LOWERED_M:
                told.append(t_s)
            free_s = t_s + TOLERANCE_S
    return told


def read_scored(file: Path) -> list[ScoredTrial]:
    """Read scored trials, one a line."""
    lines = read_foreign(file, most_mib=64).splitlines()
    return [msgspec.json.decode(line, type=ScoredTrial) for line in lines]


def score_rows(trials: Sequence[ScoredTrial]) -> list[str]:
    """Return the scores of trials under :data:`HEAD`: by gels, way and object."""
    rows = []
    for shear in dict.fromkeys(one.shear for one in trials):
        some = [one for one in trials if one.shear == shear]
        for way in some[0].ways:
            for name in ("all", *dict.fromkeys(one.object for one in some)):
                ways = [one.ways[way] for one in some if name in {"all", one.object}]
                rows.append(score_row(f"gels with shear {shear}; {way}; {name}", ways))
    return rows


@click.command(help=__doc__)
@click.argument("file", type=click.Path(exists=True, dir_okay=False, path_type=Path))
def main(file: Path) -> None:
    """Print FILE's scores."""
    click.echo("\n".join((HEAD, *score_rows(read_scored(file)))))


if __name__ == "__main__":
    main()
