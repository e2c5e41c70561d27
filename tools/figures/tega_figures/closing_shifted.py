"""Print how well closing is told from rest after the electrodes were put on again: a table of emg-decoders.md.

``TEGA_DATA=/path/to/recordings python -m tega_figures.closing_shifted``. Real EMG of one day, eight channels; another
day is simulated: the ring is turned by a share of a place (an electrode then sees that share of its neighbour), gains
are drawn anew. Fitted on two trials, recalibrated with their six seconds as after the shift, judged on the other two.
"""

from __future__ import annotations

import os
from itertools import combinations
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click
import numpy as np

from tega.decoders import fit
from tega.decoders.compare import Log
from tega_figures.recalibrated_shift import judged_closure

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["TURNS", "closing", "main", "told", "turned"]

TURNS: Final = (0.0, 0.3, 0.5, 1.0)
"""Places that the ring is turned by; neighbours are 45 degrees apart."""
_SEEDS: Final = 5
_REST, _CLOSING = 1, 8
_TRIALS: Final = (1, 2, 3, 4)


def closing(folder: Path, trials: tuple[int, ...], day: int = 1) -> Log:
    """Return rest and closing in turns, as a person would do them.

    Args:
        folder: Of the shared recordings.
        trials: Which of a day.
        day: Which.
    """
    parts: list[NDArray[np.float64]] = []
    for trial in trials:
        for motion in (_REST, _CLOSING):
            file = folder / "emg" / "longterm_myo" / f"D{day}M{motion}T{trial}.csv"
            parts.append(np.loadtxt(file, delimiter=","))
    target = np.repeat(np.tile([0.0, 1.0], len(trials)), [len(part) for part in parts])
    return Log(f"day {day}", np.concatenate(parts), target, 200.0)


def turned(log: Log, places: float, seed: int) -> Log:
    """Return a log as after the ring was turned and gains were drawn anew (0.5 to 2). Simulated."""
    gains = np.exp2(np.random.default_rng(seed).uniform(-1, 1, log.samples.shape[1]))
    seen = (1 - places) * log.samples + places * np.roll(log.samples, 1, axis=1)
    return log._replace(samples=seen * gains)


def told(folder: Path, places: float) -> tuple[list[float], list[float]]:
    """Return balanced accuracies without and with six seconds of recalibration."""
    before, after = [], []
    for first, second in combinations(_TRIALS, 2):
        others = tuple(trial for trial in _TRIALS if trial not in {first, second})
        learn, kept_back = closing(folder, (first, second) * 2), closing(folder, others)
        decoder = fit(learn.samples, learn.target, rate_hz=200.0, tau=20, full=1.0)
        for seed in range(_SEEDS):
            today = turned(learn.part(0, 0.5), places, seed)
            later = turned(kept_back, places, seed)
            anew = decoder.recalibrated(today.samples, today.target)
            before.append(judged_closure(decoder, later).balanced_accuracy)
            after.append(judged_closure(anew, later).balanced_accuracy)
    return before, after


@click.command(help=__doc__)
def main() -> None:
    """Print the table."""
    folder = Path(os.environ["TEGA_DATA"])
    click.echo("| ring turned by | told apart (worst) | after recalibration (worst) |\n|---|---|---|")
    for places in TURNS:
        before, after = told(folder, places)
        cells = [f"{np.mean(some):.2f} ({min(some):.2f})" for some in (before, after)]
        click.echo(f"| {places:g} places | {cells[0]} | {cells[1]} |")


if __name__ == "__main__":
    main()
