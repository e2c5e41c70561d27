"""Print the table of the proof, of one file or several: ``python -m tega_figures.scene.accuracy OUT.jsonl …``.

F1 has an interval of 95 % by drawing whole trials anew (bootstrap), and the share of true events that were found within
the tolerance an exact one (Clopper and Pearson), which does not vanish where nothing was missed.
"""

from __future__ import annotations

import sys
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import msgspec
import numpy as np
from scipy.stats import binomtest

from tega_figures.scene.prove import CHOSEN_ON, TOLERANCE_S, ProvenTrial
from tega_scene.outcomes import SceneEvent

EventPairs = list[tuple[SceneEvent | None, SceneEvent | None]]
"""Pairs of a true event and a measured one; ``None`` where the other has no match."""


def matched(
    true: tuple[SceneEvent, ...], measured: tuple[SceneEvent, ...], *, tolerance_s: float = TOLERANCE_S
) -> EventPairs:
    """Return pairs of events of one kind within the tolerance, nearest first, and those that are left alone."""
    near = sorted(
        (abs(a.t_s - b.t_s), i, j)
        for i, a in enumerate(true)
        for j, b in enumerate(measured)
        if a.kind == b.kind and abs(a.t_s - b.t_s) <= tolerance_s
    )
    pairs: dict[int, int] = {}
    for _, i, j in near:
        if i not in pairs and j not in pairs.values():
            pairs[i] = j
    found: EventPairs = [(one, measured[pairs[i]] if i in pairs else None) for i, one in enumerate(true)]
    return found + [(None, one) for j, one in enumerate(measured) if j not in pairs.values()]


def f1(pairs: EventPairs) -> float:
    """Return F1 of the pairs: twice the matches over all events of both."""
    both = sum(a is not None and b is not None for a, b in pairs)
    events = sum((a is not None) + (b is not None) for a, b in pairs)
    return 2 * both / events if events else float("nan")


def interval(trials: Sequence[EventPairs], *, draws: int = 2000) -> tuple[float, float]:
    """Return the interval of 95 % of F1, by drawing whole trials anew: events of one trial are not independent."""
    rng = np.random.default_rng(0)
    drawn = [
        f1([pair for k in rng.integers(len(trials), size=len(trials)).tolist() for pair in trials[k]])
        for _ in range(draws)
    ]
    low, high = np.quantile(drawn, (0.025, 0.975)).tolist()
    return low, high


def main() -> None:
    """Print the table as Markdown."""
    trials = [
        msgspec.json.decode(line, type=ProvenTrial)
        for file in sys.argv[1:]
        for line in Path(file).read_bytes().splitlines()
    ]
    sys.stdout.write(
        "| trial | Hz | film | hidden | placed | place, mm | along | across | hand, mm | slip, mm | width, mm "
        "| events |\n"
        "|---|---|---|---|---|---|---|---|---|---|---|---|\n"
    )
    for one in trials:
        pairs = matched(one.true, one.measured)
        hits = sum(a is not None and b is not None for a, b in pairs)
        place = " | ".join(f"{value:.2f}" for value in one.object_mm)
        name = one.name + (" *" if one.name in CHOSEN_ON else "")
        sys.stdout.write(
            f"| {name} | {one.rate_hz:.0f} | {one.film} | {'yes' if one.occluded else ''} | {one.seen[1]:.0%} "
            f"| {place} | {one.hand_mm[0]:.2f} | {one.slip_mm:.2f} | {one.width_mm:.2f} | {hits} of {len(pairs)} |\n"
        )
    _sum_up("all trials", trials)
    _sum_up("trials that nothing was chosen on", [one for one in trials if one.name not in CHOSEN_ON])


def _sum_up(title: str, trials: list[ProvenTrial]) -> None:
    """Print root mean squares, and how events match."""
    if not trials:
        return
    sys.stdout.write(f"\n{title}: {len(trials)}, {sum(one.n_pictures for one in trials)} pictures\n")
    for name, values in (
        ("place", [one.object_mm[0] for one in trials]),
        ("along", [one.object_mm[1] for one in trials]),
        ("across", [one.object_mm[2] for one in trials]),
        ("slip", [one.slip_mm for one in trials]),
        ("width", [one.width_mm for one in trials]),
    ):
        square = float(np.sqrt(np.nanmean(np.square(values))))
        sys.stdout.write(f"{name}: {square:.2f} mm over all, {np.nanmax(values):.2f} mm in the worst trial\n")
    by_trial = [matched(one.true, one.measured) for one in trials]
    everything = [pair for pairs in by_trial for pair in pairs]
    both = [(a, b) for a, b in everything if a is not None and b is not None]
    late = np.array([b.t_s - a.t_s for a, b in both])
    # A slip that ends in a fall goes on as long as the video does: half a picture there is centimetres.
    sizes = np.array(
        [
            1000 * (b.size_m - a.size_m)
            for one in trials
            if all(event.kind != "drop" for event in one.true)
            for a, b in matched(one.true, one.measured)
            if a is not None and b is not None and a.kind == "slip"
        ]
    )
    kinds = Counter(a.kind for a, _ in everything if a is not None)
    put = [one.put_down_mm for one in trials if one.put_down_mm is not None]
    n_true = sum(a is not None for a, _ in everything)
    exact = binomtest(len(both), n_true).proportion_ci() if n_true else (np.nan, np.nan)
    low, high = interval(by_trial)
    slid_mm = float(np.sqrt(np.mean(sizes**2))) if len(sizes) else np.nan
    sys.stdout.write(
        f"F1 {f1(everything):.3f} ({low:.3f} to {high:.3f}); {len(both)} of {n_true} true events found, exactly "
        f"{exact[0]:.3f} to {exact[1]:.3f}; within {1000 * TOLERANCE_S:.0f} ms; times "
        f"{1000 * np.abs(late).mean():.0f} ms off in the mean, {1000 * np.abs(late).max():.0f} ms at most; "
        f"{len(sizes)} slips without a fall {slid_mm:.2f} mm off; put down {put} mm off; true events: {dict(kinds)}\n"
    )
    for a, b in everything:
        if a is None or b is None:
            sys.stdout.write(f"unmatched: true {a}, measured {b}\n")


if __name__ == "__main__":
    main()
