"""Count the contacts that the tracker tells of simulated gels that nothing touches: 0 is wanted.

::

    python -m tega_figures.touch_untouched --units 12 --minutes 60 --processes 2

Every frame is rendered: the unit's still picture, as far as its colours have drifted by then, with noise drawn anew.
Seeds of units come from the hash of the commit that is checked out, or of ``--seed-text``. Exit code 1 if any contact
was told.
"""

from __future__ import annotations

import multiprocessing
import queue
import sys
from collections.abc import Iterator
from typing import Any

import click

from tega.tactile.tracker import TouchTracker
from tega_figures.check_touch_live import commit
from tega_figures.touch_presses import unit_seeds
from tega_sim.gel import CAMERA_HZ, Gel

__all__ = ["untouched_contacts"]

_text: Any = None


def untouched_contacts(seed: int, minutes: float, *, rate_hz: float = CAMERA_HZ) -> Iterator[int]:
    """Yield how many frames of an untouched unit are reported as contact, for one minute after the other.

    Leftovers, creep and drift are on. ``rate_hz`` is a whole part of the camera's 60.
    """
    gel = Gel(seed, memory=True)
    tracker = TouchTracker(gel.frame([], 0), rate_hz=rate_hz)
    step, begin = round(CAMERA_HZ / rate_hz), 0
    while begin < minutes * 60 * CAMERA_HZ:
        end = min(begin + round(60 * CAMERA_HZ), round(minutes * 60 * CAMERA_HZ))
        numbers = range(begin + step, end + step, step)
        yield sum(tracker.update(gel.frame([], number)).in_contact for number in numbers)
        begin = end


def _watch(seed: int, minutes: float, rate_hz: float) -> None:
    for reported in untouched_contacts(seed, minutes, rate_hz=rate_hz):
        _text.put((seed, reported))


def _hand_over(message: Any) -> None:
    global _text  # noqa: PLW0603  # of a worker: a queue is handed over only where a process begins
    _text = message


@click.command(context_settings={"help_option_names": ["-h", "--help"]})
@click.option("--units", type=click.IntRange(1, 100), default=4, show_default=True, help="Simulated units.")
@click.option("--minutes", type=click.IntRange(1, 600), default=60, show_default=True, help="For each unit.")
@click.option("--rate-hz", type=click.Choice(["60", "30", "20", "10"]), default="60", show_default=True)
@click.option("--processes", type=click.IntRange(1, 64), default=2, show_default=True, help="Side by side.")
@click.option("--seed-text", help="What the units' seeds are the hash of; without it the commit's own hash.")
def main(units: int, minutes: int, rate_hz: str, processes: int, seed_text: str | None) -> None:
    """Print for each unit how many frames were told as contact."""
    text = seed_text or commit()
    click.echo(f"Seeds of the units: from {text!r}.")
    seeds = unit_seeds(units, text)
    reported = dict.fromkeys(seeds, 0)
    context = multiprocessing.get_context("spawn")
    message = context.Queue()
    with (
        context.Pool(min(processes, units), _hand_over, (message,)) as pool,
        click.progressbar(length=units * minutes, label="minutes watched", file=sys.stderr) as bar,
    ):
        work = pool.starmap_async(_watch, [(seed, float(minutes), float(rate_hz)) for seed in seeds], 1)
        left = units * minutes
        while left:
            try:
                seed, n = message.get(timeout=1.0)
            except queue.Empty:
                if work.ready():
                    work.get()  # raises what a worker raised
                continue
            reported[seed] += n
            left -= 1
            bar.update(1)
    for number, (seed, n) in enumerate(reported.items()):
        click.echo(
            f"unit {number} (seed {seed}): {n} of {round(minutes * 60 * float(rate_hz))} frames told as contact"
        )
    if any(reported.values()):
        sys.exit(1)


if __name__ == "__main__":
    main()
