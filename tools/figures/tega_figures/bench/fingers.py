"""Measure the cost of 4, 8 and 16 fingers in the whole loop, and draw it.

``python -m tega_figures.bench.fingers docs/images/fingers.png`` runs ``bench loop`` with each number in turn, three
times, prints a table of the medians and draws them with the range of the runs.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Final

import click

from tega.runtime.threads import spare_threads
from tega.ui.cli.options import FiniteRange, PngPath

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from tega_figures.bench.live_loop import LoopBench

__all__ = ["main"]

FINGERS: Final = (4, 8, 16)
RUN, ALL, P50, P99 = "#c8202f", "#1f5fbf", "#1b7837", "#e08214"

Runs = dict[int, list["LoopBench"]]


def _own_ms(percentile: str) -> Callable[[LoopBench], float]:
    return lambda run: float(run.latency_ms["touch"]["own"][percentile])


_CORES: Final = {
    "run": (RUN, lambda run: run.run_cores),
    "with its hand and guard": (ALL, lambda run: run.cpu_cores),
}
_DELAYS: Final = {"p50": (P50, _own_ms("p50")), "p99": (P99, _own_ms("p99"))}
_MORE: Final = {
    "pictures a second": lambda run: run.frames_hz,
    "run: ms of processor a picture": lambda run: 1e3 * run.run_cores / run.frames_hz,
}


@click.command()
@click.argument("picture", type=PngPath())
@click.option("--seconds", type=FiniteRange(3, 3600), default=20, show_default=True)
@click.option("--rounds", type=click.IntRange(1, 100), default=3, show_default=True)
def main(picture: Path, seconds: float, rounds: int) -> None:
    """Run the loop with 4, 8 and 16 fingers in turns, print the medians and draw PICTURE."""
    spare_threads()  # as the command run does, before what is imported here
    from tega_figures.bench.live_loop import bench_loop

    runs: Runs = {n: [] for n in FINGERS}
    load = os.getloadavg()[0]
    for _ in range(rounds):
        for n in FINGERS:
            runs[n].append(bench_loop(seconds=seconds, record=False, n_fingers=n))
    _print(runs)
    _draw(picture, runs, f"{rounds} runs of {seconds:g} s each; load before them {load:.1f}")
    click.echo(f"load before the runs: {load:.1f}")


def _print(runs: Runs) -> None:
    click.echo("| fingers | " + " | ".join(map(str, runs)) + " |\n|---|" + "---:|" * len(runs))
    rows = {f"cores: {name}": of for name, (_, of) in _CORES.items()}
    rows |= {f"own part, ms, {name}": of for name, (_, of) in _DELAYS.items()} | _MORE
    first = next(iter(runs.values()))
    for name, of in rows.items():
        middles = [median(map(of, of_n)) for of_n in runs.values()]
        ratios = [f"{value:.3g} (×{value / median(map(of, first)):.2f})" for value in middles[1:]]
        click.echo(f"| {name} | " + " | ".join([f"{middles[0]:.3g}", *ratios]) + " |")


def _draw(path: Path, runs: Runs, how: str) -> None:
    from tega.ui.view.figures import new_figure

    figure = new_figure(figsize=(9, 3.8))
    cores, delays = figure.subplots(1, 2)
    for axes, lines, title in ((cores, _CORES, "cores"), (delays, _DELAYS, "own part, picture to vest, ms")):
        for name, (colour, of) in lines.items():
            _line(axes, runs, name, colour, of)
        axes.set(title=title, xlabel="fingers", xticks=FINGERS, ylim=(0, None), xlim=(0, FINGERS[-1] + 1))
        axes.legend(fontsize=8, frameon=False, loc="upper left")
    machine = next(iter(runs.values()))[0].machine
    figure.suptitle(f"{machine.cpu}, {machine.n_cores} cores, emulated devices among them; {how}", fontsize=8)
    figure.savefig(path, metadata={"Software": None})


def _line(axes: Axes, runs: Runs, name: str, colour: str, of: Callable[[LoopBench], float]) -> None:
    """Draw the medians and the range of the runs, and dotted what is in proportion to four fingers."""
    middles = [median(map(of, of_n)) for of_n in runs.values()]
    below = [middle - min(map(of, of_n)) for middle, of_n in zip(middles, runs.values(), strict=True)]
    above = [max(map(of, of_n)) - middle for middle, of_n in zip(middles, runs.values(), strict=True)]
    axes.errorbar(list(runs), middles, yerr=[below, above], marker="o", capsize=3, color=colour, label=name)
    axes.plot([0, FINGERS[-1]], [0, middles[0] * FINGERS[-1] / FINGERS[0]], ":", lw=1, color=colour)


if __name__ == "__main__":
    main()
