"""Judge open against closed as on another day: print the table of docs/evidence/emg-decoders.md.

::

    TEGA_DATA=/path/to/recordings python -m tega_figures.worn_again

Real EMG of one day (eight pods, rest and hand closing, four trials each), one trial kept back in turn; the other day is
simulated: the kept trial's ring is turned, its gains are drawn anew, noise is added, pods fail. A model is judged as it
is, and recalibrated by the other three trials of the same simulated day.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Final

import click
import numpy as np

from tega.stages.learned import fit
from tega.stages.learned.judge import judge

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega.stages.learned import LearnedDecoder

    Samples = NDArray[np.float64]
    Worn = Callable[[Samples], Samples]

__all__ = ["main", "other_days"]

RATE_HZ, TAU, PODS = 200.0, 20, 8
TRIALS: Final = (1, 2, 3, 4)
REST, CLOSING = 1, 8
_NOISE: Final = 0.007  # of a pod at rest


def other_days(seed: int = 0) -> Iterator[tuple[str, Worn]]:
    """Yield simulated other days, and what they are called."""
    rng = np.random.default_rng(seed)
    noise = rng.normal(size=(300, PODS))
    yield "as it was", lambda x: x
    for places in (1, -1, 2, -2, 3, 4):
        name = "ring turned by 1 or 2 pods" if abs(places) < 3 else "ring turned by 3 or 4 pods"
        yield name, lambda x, k=places: np.roll(x, k, axis=1)  # type: ignore[misc]
    for share in rng.uniform(0.2, 0.8, 6):
        yield "ring turned between pods", lambda x, s=share: (1 - s) * x + s * np.roll(x, 1, axis=1)  # type: ignore[misc]
    for most in (2, 4):
        for gains in most ** rng.uniform(-1, 1, (8, PODS)):
            yield f"gain of each pod 1/{most} to {most}", lambda x, g=gains: x * g  # type: ignore[misc]
    for gain in (0.25, 0.5, 2.0, 4.0):
        yield f"all pods x {gain:g}", lambda x, g=gain: x * g  # type: ignore[misc]
    for times in (1.5, 3, 6):
        yield f"noise of {times:g} times rest", lambda x, t=times: x + t * _NOISE * noise  # type: ignore[misc]
    for pod in range(PODS):
        dead, loud = np.arange(PODS) == pod, 0.08 * noise * (np.arange(PODS) == pod)
        yield "a pod dead", lambda x, d=dead: np.where(d, _NOISE * noise, x)  # type: ignore[misc]
        yield "a pod noisy, 11 times rest", lambda x, n=loud: x + n  # type: ignore[misc]
    for _ in range(8):
        k, gains, sd = int(rng.integers(-2, 3)), 2 ** rng.uniform(-1, 1, PODS), rng.uniform(0, 3 * _NOISE)
        yield (
            "turned by up to 2, gains, noise",
            lambda x, k=k, g=gains, s=sd: np.roll(x, k, axis=1) * g + s * noise,  # type: ignore[misc]
        )


@click.command(help=__doc__)
def main() -> None:
    """Print the table."""
    folder = Path(os.environ["TEGA_DATA"]) / "emg" / "longterm_myo"
    trials = {
        (motion, n): np.loadtxt(folder / f"D1M{motion}T{n}.csv", delimiter=",")
        for motion in (REST, CLOSING)
        for n in TRIALS
    }

    def turns(which: tuple[int, ...], worn: Worn) -> tuple[Samples, Samples]:
        """Return rest and closing in turns, and the closure meant."""
        parts = [worn(trials[motion, n]) for n in which for motion in (REST, CLOSING)]
        return np.concatenate(parts), np.concatenate([np.full(len(p), k % 2.0) for k, p in enumerate(parts)])

    def accuracy(decoder: LearnedDecoder, kept: int, worn: Worn) -> float:
        emg, wanted = turns((kept,) * 3, worn)
        decoder.restart()
        closure = decoder.process(emg)
        meant = wanted[: len(closure) * TAU].reshape(-1, TAU).mean(axis=1)
        return judge(closure, 1 + 4 * closure, meant, TAU / RATE_HZ).balanced_accuracy

    found: dict[str, list[tuple[float, float]]] = {}
    for kept in TRIALS:
        others = tuple(n for n in TRIALS if n != kept)
        decoder = fit(*turns(others * 2, lambda x: x), rate_hz=RATE_HZ, tau=TAU)
        for name, worn in other_days():
            anew = decoder.recalibrated(*turns(others, worn))
            found.setdefault(name, []).append((accuracy(decoder, kept, worn), accuracy(anew, kept, worn)))
    click.echo("| simulated other day | untouched, worst | recalibrated, worst |\n|---|---|---|")
    for name, pairs in found.items():
        means, worst = np.mean(pairs, axis=0), np.min(pairs, axis=0)
        cells = [f"{100 * mean:.0f} %, {100 * least:.0f} %" for mean, least in zip(means, worst, strict=True)]
        click.echo(f"| {name} | {' | '.join(cells)} |")


if __name__ == "__main__":
    main()
