"""Draw cost per block against error, for features and models of learned decoders, and print the tables of the page.

::

    TEGA_DATA=/path/to/recordings python tools/figures/decoder_pareto.py docs/images/emg-decoders-pareto.png

Cost: median wall time of one block from Python, 8 channels at 1 kHz, blocks of 100 ms, in one process. Error: 1 less
the mean rank correlation of closure with force on the second halves of six squeezes of three channels (first halves
teach).
"""

from __future__ import annotations

import os
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from tega.errors import TegaError
from tega.runtime.files.signals import read_signals
from tega.runtime.files.tables.table import Reading
from tega.stages.learned import LearnedDecoder, fit
from tega.stages.learned.compare import Log, best_channels, compare, shifted_electrode, two_halves

NAMES = ("v1", "v2", "v8", "v10", "v6", "v12")
FEATURES = (
    ("MAV",),
    ("WL",),
    ("LOGVAR",),
    ("MAV", "LOGVAR"),
    ("MAV", "WL", "LOGVAR"),
    ("MAV", "ZC", "SSC"),
    ("MAV", "LOGVAR", "AR"),
    ("MAV", "WL", "ZC", "SSC", "LOGVAR", "AR"),
)
MODELS = ("ridge", "huber", "kernel")
DECODERS = ("rules-paper", "rules", "proportional", "learned", "learned-huber", "learned-kernel")


def recording(folder: Path, name: str, channels: tuple[int, ...] = (3, 6, 8)) -> Log:
    """Return EMG and force of a squeeze."""
    file = folder / "emg" / "my_thesis" / f"recording_force_{name}.mat"
    emg = read_signals(file, Reading(channels=channels)).samples
    force = read_signals(file, Reading(channels=(1,), variable="Force")).samples
    n = min(len(emg), len(force))
    return Log(name, emg[:n], force[:n, 0], 200.0)


def power_grip(folder: Path, user: int) -> Log:
    """Return a person's rest and power grips, one after the other, from sensors that give an envelope."""
    file = folder / "emg" / "unibo_inail" / f"user_{user}_day_1_posture_1.mat"
    emg = read_signals(file).samples
    label = read_signals(file, Reading(channels=(1,), variable="relabel")).samples
    closed = label[: len(emg), 0] == 2
    grips = np.flatnonzero(closed)
    used = slice(max(0, grips[0] - 2500), grips[-1] + 2500)
    clean = np.isin(label[used, 0], (1, 2))
    return Log(f"unibo_inail user {user}", emg[used][clean], closed[used][clean] * 1.0, 500.0, "envelope")


def grip_force(folder: Path, name: str) -> Log:
    """Return a precision grip as it was polled, 70 % of the rows repeats; a glued force reply is interpolated."""
    file = folder / "emg" / "gripping_force" / f"{name}.csv"
    rows = read_signals(file, Reading(channels=tuple(range(1, 10)))).samples
    valid = np.flatnonzero(rows[:, 0] <= 5000)
    force = np.interp(np.arange(len(rows)), valid, rows[valid, 0])
    return Log(f"gripping_force {name}", rows[:, 1:], force - np.percentile(force, 2), 243.0)


def cost_us(model: Any, features: tuple[str, ...]) -> float:
    """Return the median time of a block, microseconds."""
    rng = np.random.default_rng(1)
    closure = np.interp(np.arange(40_000) / 1000, np.arange(0, 41, 2), np.arange(21) % 2)
    emg = rng.normal(size=(40_000, 8)) * (3 + 90 * closure[:, None])
    decoder: LearnedDecoder = fit(emg, closure, rate_hz=1000, tau=100, model=model, features=features)
    took = []
    for block in np.split(emg, 400):
        start = time.perf_counter_ns()
        decoder.process(block)
        took.append(time.perf_counter_ns() - start)
    return float(np.median(took)) / 1000


def mean_error(logs: list[Log], model: str, features: tuple[str, ...]) -> float:
    """Return 1 less the mean rank correlation."""
    name = "learned" if model == "ridge" else f"learned-{model}"
    found = [compare(*two_halves(log), [name], features=features)[0].figures.rank_correlation for log in logs]
    return 1.0 - float(np.mean(found))


def main(picture: Path) -> None:  # noqa: PLR0912  # one table after the other
    """Draw, and print the tables."""
    data = Path(os.environ["TEGA_DATA"])
    logs = [recording(data, name) for name in NAMES]
    figure = Figure(figsize=(7, 4.5), layout="constrained")
    panel = figure.subplots()
    points: list[tuple[float, float, str, tuple[str, ...]]] = []
    for model, marker in zip(MODELS, "osD", strict=True):
        points += [(cost_us(model, f), mean_error(logs, model, f), model, f) for f in FEATURES]
        own = [p for p in points if p[2] == model]
        panel.scatter([p[0] for p in own], [p[1] for p in own], marker=marker, s=28, label=model)
    for us, wrong, model, features in points:
        print(f"{model:7} {'+'.join(features):28} {us:6.0f} µs  {wrong:.3f}")
    best = sorted(p for p in points if not any(q[0] < p[0] and q[1] < p[1] for q in points))
    panel.step([p[0] for p in best], [p[1] for p in best], where="post", color="0.6", linewidth=1)
    for number, (us, wrong, _, _) in enumerate(best, start=1):
        panel.annotate(str(number), (us, wrong), fontsize=9, xytext=(-11, -9), textcoords="offset points")
    front = [f"{n}  {'+'.join(f)}, {model}: {us:.0f} µs" for n, (us, _, model, f) in enumerate(best, start=1)]
    # On white, above the line of the limit.
    panel.text(
        0.42, 0.04, "\n".join(["nothing is cheaper and better than", *front]), transform=panel.transAxes, zorder=3,
        backgroundcolor="white",
    )  # fmt: skip
    panel.text(150, 0.99, " limit", transform=panel.get_xaxis_transform(), va="top", color="0.4")
    panel.axvline(150, color="0.6", linestyle=":", linewidth=1)
    panel.set_xlabel("cost: median time of a block (µs), 8 channels at 1 kHz")
    panel.set_ylabel("error: 1 − mean rank correlation with force")
    panel.legend(title="model", loc="upper left")
    figure.savefig(picture, dpi=120)
    for title, swapped in (("second halves", False), ("first halves (swapped)", True)):
        print(f"\n| {title} | {' | '.join(NAMES)} |")
        rows: dict[str, list[str]] = {name: [] for name in DECODERS}
        for log in logs:
            for told in compare(*two_halves(log, swapped=swapped), DECODERS):
                f = told.figures
                rows[told.decoder].append(f"{f.rank_correlation:.2f} ({f.changes_per_s:.2f}/s)")
        for name, cells in rows.items():
            print(f"| {name} | {' | '.join(cells)} |")
    print("\nother sources, second half (first half): rank, told apart")
    for log in (*(power_grip(data, u) for u in (1, 5)), *(grip_force(data, n) for n in ("01", "05"))):
        for name in DECODERS:
            said = []
            for swapped in (False, True):
                try:
                    f = compare(*two_halves(log, swapped=swapped), [name])[0].figures
                    said.append(
                        f"{f.rank_correlation:.2f} / {100 * f.balanced_accuracy:.0f} % / {f.changes_per_s:.2f}/s / "
                        f"{f.false_closings_per_min:.1f} a minute"
                    )
                except TegaError as error:
                    said.append(str(error))
            print(f"| {log.name} ({log.rate_hz:g} Hz) | {name} | {said[0]} | {said[1]} |")
    print("\nchannels: mean rank correlation of rules and learned, best n by the training half")
    for n in range(1, 9):
        found: dict[str, list[float]] = {"rules": [], "learned": []}
        for name in NAMES:
            train, judged = two_halves(recording(data, name, tuple(range(1, 9))))
            used = best_channels(train, n)
            for told in compare(train.columns(used), judged.columns(used), list(found)):
                found[told.decoder].append(np.nan_to_num(told.figures.rank_correlation))
        print(n, {k: round(float(np.mean(v)), 3) for k, v in found.items()})
    print("\nelectrodes shifted by one place, gains drawn anew (simulated): mean rank correlation")
    shifted: dict[str, list[float]] = {"rules": [], "learned": []}
    for log in logs:
        train, judged = two_halves(log)
        for seed in range(3):
            for told in compare(train, shifted_electrode(judged, seed=seed), list(shifted)):
                shifted[told.decoder].append(np.nan_to_num(told.figures.rank_correlation))
    print({k: round(float(np.mean(v)), 3) for k, v in shifted.items()})


if __name__ == "__main__":
    main(Path(sys.argv[1]))
