"""Measure the readings of touch: time a picture against how well they rank known forces."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.emg.score import rank_correlation
from tega.tactile import ContactReader, contact_metrics, read_contact
from tega.tactile.tracker import TouchTracker
from tega_figures.bench.timing import take_turns, timing
from tega_figures.bench.variants import CONTACT_LAWS
from tega_figures.pareto.drawing import Choice, PricedVariant
from tega_sim.gel import Gel, ball

__all__ = ["touch_reading"]

Image = NDArray[np.uint8]
Reads = Callable[[Image], Any]
PLACES: Final = ((119.5, 159.5), (80.0, 110.0), (150.0, 220.0))
SEEDS: Final = (1, 2, 3)
# Frames at 60 a second: untouched, pressed ever harder, held, let go and looked at later.
REST, RAMP, HELD, LATER, WATCHED = 30, 90, 120, 90, 60
LEAST_N, MOST_N = 0.3, 8.0


class ScriptedPress(NamedTuple):
    """One press: what is shown, and what is true.

    Attributes:
        still: The untouched gel.
        frames: One a sixtieth of a second.
        force_n: Of each; 0 where nothing touches.
    """

    still: Image
    frames: list[Image]
    force_n: NDArray[np.float64]


def presses() -> list[ScriptedPress]:
    """Return a press at each place of gels that creep, keep something of a press, and drift."""
    ramp = np.geomspace(LEAST_N, MOST_N, RAMP)
    force_n = np.concatenate([np.zeros(REST), ramp, np.full(HELD, MOST_N), np.zeros(LATER + WATCHED)])
    found = []
    for seed in SEEDS:
        for place in PLACES:
            gel = Gel(seed, memory=True)
            shapes = [[ball(force_n=float(f), centre_xy=place)] if f else [] for f in force_n]
            frames = [gel.frame(shape, k) for k, shape in enumerate(shapes)]
            found.append(ScriptedPress(Gel(seed).still(), frames, force_n))
    return found


def touch_reading(*, budget_s: float) -> Choice:
    """Measure the equations as printed and read otherwise, ``paper``, ``live`` and the tracker."""
    ways: dict[str, Callable[[Image], Reads]] = {
        law.name: partial(_by_law, difference=law.difference, spread=law.spread) for law in CONTACT_LAWS
    }
    ways |= {"paper": _paper, "live": _live, "live tracker": _tracker}
    displayed = presses()
    timed = displayed[0].frames[REST + RAMP // 2]
    calls = {name: partial(make(displayed[0].still), timed) for name, make in ways.items()}
    turns = take_turns(calls, budget_s=budget_s)
    pressed = slice(REST, REST + RAMP + HELD)
    after = slice(REST + RAMP + HELD + LATER, None)
    variants = []
    for name, make in ways.items():
        reported = []
        ranks = []
        for press in displayed:
            read = make(press.still)
            contacts = [read(frame) for frame in press.frames]
            reported.append([bool(m.in_contact) for m in contacts])
            ranks.append(
                _rank(press.force_n[REST : REST + RAMP], [m.eda for m in contacts[REST : REST + RAMP]])
            )
        felt = np.array(reported)
        wrong = [
            float(1 - felt[:, pressed].mean()),
            float(felt[:, :REST].mean()),
            float(felt[:, after].mean()),
        ]
        variants.append(
            PricedVariant(
                name=name,
                cost=timing(turns[name]).median_us,
                error=100 * sum(wrong) / 3,
                beside={
                    "pressed, not detected, %": 100 * wrong[0],
                    "untouched, detected, %": 100 * wrong[1],
                    "1.5 s after release, detected, %": 100 * wrong[2],
                    "1 - rank of force with area": 1 - float(np.mean(ranks)),
                },
                default=name == "live tracker",
            )
        )
    return Choice(
        title="Touch: the reading",
        setting="`metric.name`, `metric.options`",
        cost="µs a picture, touched",
        error="wrong, % (mean of three)",
        how=(
            "Simulated pictures of three gels that creep and drift: a ball at three places, half a "
            "second untouched, pressed from 0.3 to 8 N "
            "in 1.5 s, held for 2 s, and one second from 1.5 s after release on. Told wrongly is the "
            "mean of the three shares beside it. "
            "On recorded sensors the readings are compared in [touch-peers.md](touch-peers.md)."
        ),
        why=(
            "Here only the tracker detects every press and is silent on the untouched gel and on what "
            "a press leaves behind. "
            "The equations as printed report a contact in all pictures or, signed, on one sensor in three. Time is no "
            "reason: each takes some "
            "tens of microseconds of the 16 ms between two pictures."
        ),
        variants=variants,
    )


def _rank(force_n: NDArray[np.float64], values: list[float]) -> float:
    # A reading that says the same of all forces has no rank: it tells nothing.
    return float(rank_correlation(force_n, values)) if len(set(values)) > 1 else 0.0


def _by_law(still: Image, *, difference: Any, spread: Any) -> Reads:
    return lambda image: contact_metrics(image, still, difference=difference, spread=spread)


def _paper(still: Image) -> Reads:
    return lambda image: read_contact(image, still, reading="paper")


def _live(still: Image) -> Reads:
    return ContactReader(still).read


def _tracker(still: Image) -> Reads:
    return TouchTracker(still).update
