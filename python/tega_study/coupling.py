"""Correlate touch with the chosen pose over a trial, to separate responses to touch from mere mechanics.

A closing hand raises touch by itself. So a correlation is shown beside its value without any response: with the touch
of another trial, in the arm without feedback, and at other lags. Lag ``l > 0``: touch follows the pose, by mechanics.
Lag ``l < 0``: the pose follows touch, as in a response, and no response is quicker than 0.2 s.
"""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import read_words
from tega.runtime.files.whole_file import write_whole
from tega.runtime.lifecycle import scipy_stats
from tega_learn.score import pearson

GRID_HZ = 10.0
"""Rate at which courses are compared: a pose lasts at least a tenth of a second, so more would add no information."""

POSES = 5


class TouchCourse(NamedTuple):
    """A trial's course; float64 (n,) each.

    Times rise from the trial's start. Concentration and area are normalised, means over the fingers in contact,
    0 to 1 (reading A74); the chosen pose is 0 to 4.
    """

    t_s: NDArray[np.float64]
    cci: NDArray[np.float64]
    eda: NDArray[np.float64]
    pose: NDArray[np.float64]


class Correlation(NamedTuple):
    """A Pearson correlation of two series that go on from one sample to the next.

    ``r`` is NaN where a series does not change. ``n_eff`` is how many independent samples they are worth
    (Bartlett); ``low`` to ``high`` the 95 % interval by Fisher's z with these, NaN below four.
    """

    r: float
    n: int
    n_eff: float
    low: float
    high: float


def read_course(path: Path) -> TouchCourse:
    """Read ``t_s,cci,eda,pose``; gaps, or times that do not rise, are a ``RecordingError``."""
    try:
        rows = list(csv.reader(io.StringIO(read_words(path, most_mib=64), newline="")))
        table = np.array([[float(cell) for cell in row] for row in rows[1:]], dtype=np.float64).reshape(-1, 4)
    except (OSError, ValueError, csv.Error) as error:
        raise RecordingError(f"{path}: is no course of a trial: {error}", "restore it from a copy") from error
    if not rows or rows[0] != list(TouchCourse._fields):
        raise RecordingError(f"{path}: has other columns than t_s,cci,eda,pose", "restore it from a copy")
    if not np.isfinite(table).all() or np.any(np.diff(table[:, 0]) <= 0):
        raise RecordingError(f"{path}: holds a gap, or times that do not rise", "restore it from a copy")
    return TouchCourse(*table.T)


def write_course(path: Path, course: TouchCourse) -> None:
    """Write a course, whole or not at all; the file's folder is made."""
    rows = np.column_stack(course)
    text = "t_s,cci,eda,pose\n" + "".join(f"{t:.3f},{c:.5f},{e:.5f},{p:.0f}\n" for t, c, e, p in rows)
    write_whole(path, text)


def on_grid(course: TouchCourse) -> TouchCourse:
    """Bring a course onto an even grid: touch as the mean of each cell, the pose that held at the cell's end.

    Cells without a sample are left out; the grid's times are the cells' ends.
    """
    cells = np.floor(course.t_s * GRID_HZ + 1e-9).astype(int)
    there, start = np.unique(cells, return_index=True)
    last = np.append(start[1:], len(cells)) - 1
    counts = np.diff(np.append(start, len(cells)))
    return TouchCourse(
        (there + 1) / GRID_HZ,
        np.add.reduceat(course.cci, start) / counts if len(start) else course.cci,
        np.add.reduceat(course.eda, start) / counts if len(start) else course.eda,
        course.pose[last] if len(start) else course.pose,
    )


def effective_n(x: NDArray[np.float64], y: NDArray[np.float64], *, lags: int) -> float:
    """Return how many independent samples two series are worth (Bartlett; Pyper and Peterman 1998), at least 3."""
    n = len(x)

    def rho(values: NDArray[np.float64], lag: int) -> float:
        off = values - values.mean()
        return float(off[lag:] @ off[: n - lag] / (off @ off))

    total = sum((1 - lag / n) * rho(x, lag) * rho(y, lag) for lag in range(1, min(lags, n - 1) + 1))
    inflated = 1 + 2 * total
    return float(n) if inflated <= 1 else max(3.0, n / inflated)


def correlate(x: NDArray[np.float64], y: NDArray[np.float64]) -> Correlation:
    """Correlate two series, judged by as many independent samples as they are worth."""
    r, n = pearson(x, y), len(x)
    if math.isnan(r):
        return Correlation(r, n, math.nan, math.nan, math.nan)
    n_eff = effective_n(x, y, lags=n // 4)
    if n_eff <= 3 or abs(r) >= 1:
        return Correlation(r, n, n_eff, math.nan, math.nan)
    reach = float(scipy_stats().norm.ppf(0.975)) / math.sqrt(n_eff - 3)
    z = math.atanh(r)
    return Correlation(r, n, n_eff, math.tanh(z - reach), math.tanh(z + reach))


def lag_sweep(pose: NDArray[np.float64], touch: NDArray[np.float64], *, most: int) -> list[tuple[int, float]]:
    """Return the correlation of the pose now with touch ``l`` samples later, ``l`` from ``-most`` to ``most``."""
    n = len(pose)
    found = []
    for lag in range(-most, most + 1):
        a, b = (pose[: n - lag], touch[lag:]) if lag >= 0 else (pose[-lag:], touch[: n + lag])
        found.append((lag, pearson(a, b) if abs(lag) < n else math.nan))
    return found


def other_trials(
    poses: Sequence[NDArray[np.float64]], touches: Sequence[NDArray[np.float64]]
) -> list[list[float]]:
    """Correlate each trial's pose with every other trial's touch, over the shorter one's length.

    This is the correlation without any response: the course that all these trials share.
    """
    return [
        [pearson(pose[: len(touch)], touch[: len(pose)]) for j, touch in enumerate(touches) if j != i]
        for i, pose in enumerate(poses)
    ]


def response_slope(pose: NDArray[np.float64], touch: NDArray[np.float64]) -> float:
    """Return by how many levels the pose changes within 0.3 s for a unit of touch 0.4 s before.

    Below 0, more touch leads to a looser grip. Noisy: needs many trials. Samples without touch are skipped.
    """
    ahead, ago = round(0.3 * GRID_HZ), round(0.4 * GRID_HZ)
    felt = touch[: len(touch) - ago - ahead]
    change = pose[ago + ahead :] - pose[ago : len(pose) - ahead]
    use = felt > 0
    felt, change = felt[use], change[use]
    if len(felt) < 3 or np.ptp(felt) == 0:
        return math.nan
    off = felt - felt.mean()
    return float(off @ change / (off @ off))


def finite(value: float) -> float | None:
    """Return a number, or ``None`` where it is not defined."""
    return value if math.isfinite(value) else None


def fisher_z(r: float) -> float:
    """Return Fisher's z of a correlation, finite for any."""
    return math.atanh(min(max(r, -0.999999), 0.999999))


def fisher_mean(rs: Iterable[float]) -> float:
    """Average correlations by Fisher's z; those that are not defined are left out.

    Example:
        >>> round(fisher_mean([0.9, 0.8, 0.7]), 9)
        0.816439329
    """
    zs = [fisher_z(r) for r in rs if not math.isnan(r)]
    return math.tanh(sum(zs) / len(zs)) if zs else math.nan


def dwell(pose: NDArray[np.float64]) -> tuple[float, ...]:
    """Return the share of samples at each of the poses 0 to 4."""
    levels = np.clip(np.rint(pose), 0, POSES - 1).astype(int)
    return tuple((np.bincount(levels, minlength=POSES) / max(1, len(levels))).tolist())


def transitions(pose: NDArray[np.float64]) -> tuple[int, int]:
    """Return how often the pose changes, and how often into or out of an intermediate one (1 to 3)."""
    levels = np.rint(pose)
    change = np.flatnonzero(np.diff(levels))
    within = [i for i in change if 1 <= levels[i] <= 3 or 1 <= levels[i + 1] <= 3]
    return len(change), len(within)
