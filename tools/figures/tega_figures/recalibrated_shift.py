"""Print what ten seconds restore of a learned decoder after a shift of the electrodes: a table of emg-decoders.md.

``TEGA_DATA=/path/to/recordings python -m tega_figures.recalibrated_shift``. Real EMG beside a force; the shift is
simulated: channels rotated by a place or two, gains drawn anew three times. Fitted on first halves, recalibrated with
their weakest and strongest five seconds as they would be after the shift, judged on second halves.
"""

from __future__ import annotations

import itertools
import os
from pathlib import Path
from typing import TYPE_CHECKING, Final, NamedTuple

import click
import numpy as np

from tega.runtime.files.signals import read_signals
from tega.runtime.files.tables.table import Reading
from tega.stages.learned import LearnedDecoder, fit
from tega.stages.learned.compare import Log, shifted_electrode, two_halves
from tega.stages.learned.judge import DecoderFigures, judge

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["NAMES", "TenSeconds", "judged_closure", "main", "squeeze", "ten_seconds"]

NAMES: Final = ("v1", "v2", "v8", "v10", "v6", "v12")
_HALF_BLOCKS: Final = 50
"""Five seconds."""
_SEEDS: Final = (1, 2, 3)
_PLACES: Final = (1, 2)


class TenSeconds(NamedTuple):
    """Samples of a recalibration.

    Attributes:
        rest: float64 (n, channels), of the weakest blocks in the order of time.
        effort: Likewise of the strongest.
    """

    rest: NDArray[np.float64]
    effort: NDArray[np.float64]


def squeeze(folder: Path, name: str) -> Log:
    """Return EMG of channels 3, 6 and 8 beside a force.

    Args:
        folder: Of the shared recordings.
        name: One of :data:`NAMES`.
    """
    file = folder / "emg" / "my_thesis" / f"recording_force_{name}.mat"
    emg = read_signals(file, Reading(channels=(3, 6, 8))).samples
    force = read_signals(file, Reading(channels=(1,), variable="Force")).samples
    n = min(len(emg), len(force))
    return Log(name, emg[:n], force[:n, 0], 200.0)


def ten_seconds(learn: Log, today: NDArray[np.float64]) -> TenSeconds:
    """Return five seconds of the weakest and five of the strongest force.

    Args:
        learn: Says when the force was so.
        today: The samples to take, (n, channels), of the same times.
    """
    tau = learn.tau
    n = len(learn.target) // tau
    order = np.argsort(learn.target[: n * tau].reshape(n, tau).mean(axis=1))
    cut = today[: n * tau].reshape(n, tau, -1)
    weak, strong = (cut[np.sort(some)] for some in (order[:_HALF_BLOCKS], order[-_HALF_BLOCKS:]))
    return TenSeconds(weak.reshape(-1, cut.shape[2]), strong.reshape(-1, cut.shape[2]))


def judged_closure(decoder: LearnedDecoder, log: Log) -> DecoderFigures:
    """Return how well a decoder's closure, from its start, follows a log's target."""
    decoder.restart()
    closure = decoder.process(log.samples)
    tau, full = decoder.model.tau, decoder.model.full
    wanted = (log.target[: len(closure) * tau].reshape(-1, tau).mean(axis=1) / full).clip(0, 1)
    return judge(closure, decoder.levels, wanted, tau / log.rate_hz)


@click.command(help=__doc__)
def main() -> None:
    """Print the table."""
    folder = Path(os.environ["TEGA_DATA"])
    click.echo("| | unmoved | moved | moved, recalibrated | worst |\n|---|---|---|---|---|")
    ratios, every = [], []
    for name in NAMES:
        learn, judged = two_halves(squeeze(folder, name))
        old = fit(learn.samples, learn.target, rate_hz=learn.rate_hz, tau=learn.tau)
        unmoved = judged_closure(old, judged).rank_correlation
        pairs = []
        for seed, places in itertools.product(_SEEDS, _PLACES):
            today = shifted_electrode(learn, seed=seed, places=places).samples
            later = shifted_electrode(judged, seed=seed, places=places)
            rest, effort = ten_seconds(learn, today)
            new = old.recalibrated(
                np.concatenate([rest, effort]), np.repeat([0.0, 1.0], [len(rest), len(effort)])
            )
            pairs.append([judged_closure(one, later).rank_correlation for one in (old, new)])
            size = [
                np.abs(some - np.median(some, axis=0)).mean(axis=0)
                for some in (effort, ten_seconds(learn, learn.samples).effort)
            ]
            ratios.append(size[0] / size[1])
        before, after = np.mean(pairs, axis=0)
        every += pairs
        click.echo(
            f"| {name} | {unmoved:.2f} | {before:.2f} | {after:.2f} | {np.min(pairs, axis=0)[1]:.2f} |"
        )
    before, after = np.mean(every, axis=0)
    inside = [np.mean([((r >= 1 / most) & (r <= most)).all() for r in ratios]) for most in (2, 4)]
    click.echo(
        f"\nmean of {len(every)}: {before:.2f} -> {after:.2f}; all channels within a half to twice what they gave: "
        f"{100 * inside[0]:.0f} %, within a quarter to four times: {100 * inside[1]:.0f} %"
    )


if __name__ == "__main__":
    main()
