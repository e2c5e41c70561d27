"""Compare the times in a file with its rate: losses, repeats, steps back, another rate, and where each sample falls.

A device numbers its samples on its own crystal, and a file's times are stamps of the device, of a computer, or of
both. So times are compared with an even course. The rate is the median slope over many rows, a lasting step up is a
loss, and a step down is a clock that was set. The remaining differences move samples by less than a sample's length,
or slowly (drift).
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.errors import RecordingError

RATE_TOLERANCE: Final = 0.05
"""As for a live source: a rate further off than this is not the one the filter was made and calibrated for."""

MOST_GAP_S: Final = 3600.0
"""A longer gap is no loss: two recordings in one file, or a clock that was set."""

_FEWEST = 16
_BLOCK = 262_144
_NEAR = 64
_MOST_SLOPES = 100_000
# With fewer different stamps than this share of the rows, samples came in batches.
_MOST_SHARED = 0.7
# A counter of 16 bits wraps within this; a greater one that falls was reset.
_MOST_TURN = 70_000
_SLOPE_ROWS = 1000
_DAY_S = 86_400.0
# EMG is sampled between these rates; a time without a unit is read in the one that gives such a rate.
_RATES_HZ = (50.0, 50_000.0)
_SCALES = (1.0, 1e-3, 1e-6, 1e-9)


class Timing(NamedTuple):
    """Course of a file's times.

    Attributes:
        rate_hz: Samples per second between losses.
        repeated: Rows that repeat the one before with its time, which are not used.
        lost: Rows before which samples are missing, and how many; rows are counted without the repeated ones.
        knots: Rows at which a time is known, float64 (k,).
        offsets_s: Time of these rows less their number over the rate, losses counted in.
        faults: Findings, one sentence each.
    """

    rate_hz: float
    repeated: NDArray[np.int64]
    lost: list[tuple[int, int]]
    knots: NDArray[np.float64]
    offsets_s: NDArray[np.float64]
    faults: list[str]

    def offset_s(self, row: int) -> float:
        """Return a row's time less its number over the rate, losses counted in."""
        return float(np.interp(row, self.knots, self.offsets_s)) if len(self.knots) else 0.0


def to_seconds(
    times: NDArray[np.float64], unit_s: float | None, rate_hz: float | None
) -> NDArray[np.float64] | None:
    """Return a time column, float64 (n,), in seconds; ``None`` where no unit makes sense of it.

    ``unit_s`` is its unit in seconds, ``rate_hz`` the stated samples per second; ``None`` where not stated.
    """
    if unit_s is not None:
        return times * unit_s
    step = slope_of(times)
    if step is None or step <= 0:
        return None
    for scale in _SCALES:
        if rate_hz is not None and abs(1 / (step * scale) / rate_hz - 1) <= 4 * RATE_TOLERANCE:
            return times * scale
    for scale in _SCALES:
        if _RATES_HZ[0] <= 1 / (step * scale) <= _RATES_HZ[1]:
            return times * scale
    return None


def slope_of(times: NDArray[np.float64]) -> float | None:
    """Return the usual step between two rows' times, without losses and clocks that were set; ``None`` for too few.

    Example:
        >>> round(slope_of(np.arange(1000) // 10 * 0.04), 6)
        0.004
    """
    times = times[np.isfinite(times)]
    rows = _stamped(times)
    if len(times) < _FEWEST or len(rows) < 3:
        return None
    far = max(1, min(_SLOPE_ROWS, len(rows) // 8))
    places = np.arange(0, len(rows) - far, max(1, len(rows) // _MOST_SLOPES))
    before, after = rows[places], rows[places + far]
    slopes = np.sort((times[after] - times[before]) / (after - before))
    quarter = len(slopes) // 4
    return float(slopes[quarter : len(slopes) - quarter].mean())


def _stamped(times: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the rows with valid times: all, or the first of each batch of samples with one stamp."""
    changed = np.flatnonzero(np.diff(times)) + 1
    return np.arange(len(times)) if len(changed) >= _MOST_SHARED * len(times) else changed


def compare(
    times_s: NDArray[np.float64],
    samples: NDArray[np.float64],
    *,
    rate_hz: float | None,
    counted: list[tuple[int, int]],
    subject: str,
    file: str,
) -> Timing:
    """Compare the rows' times, float64 (n,), with a rate, ``None`` to use that of the times.

    ``samples`` are (n, channels), ``counted`` are losses by a counter, as :attr:`Timing.lost`; ``subject``
    names the clock for messages, such as ``column "time"``. Times that contradict the rate, or jump too far
    to be a loss, are ``RecordingError``.
    """
    times_s, faults = _continued(times_s), list[str]()
    repeated = _repeated(times_s, samples)
    if len(repeated):
        faults.append(f"{len(repeated)} rows came twice, with their times; used once")
        times_s = np.delete(times_s, repeated)
    step_s = slope_of(times_s)
    if step_s is None or step_s <= 0:
        raise RecordingError(
            f"{file}: {subject} does not rise",
            "set time to the right column, or to none to ignore the file's times",
        )
    measured_hz = _round_rate(1 / step_s, rate_hz)
    if rate_hz is not None and abs(measured_hz / rate_hz - 1) > RATE_TOLERANCE:
        raise RecordingError(
            f"{file}: {subject} says {measured_hz:.6g} samples/s, {rate_hz:g} were stated",
            f"leave the rate out or set it to {measured_hz:.6g}; set time to none if {subject} is wrong",
        )
    rises, back = _jumps(times_s, step_s, subject=subject, file=file)
    if rises or back:  # the rate between them is known better than over them
        step_s = _even_step(times_s, step_s, rises, back)
        measured_hz = _round_rate(1 / step_s, rate_hz)
        rises, back = _jumps(times_s, step_s, subject=subject, file=file)
    lost = [(row, round(rise_s / step_s)) for row, rise_s in rises]
    if sum(n for _, n in counted) > sum(n for _, n in lost) and not len(repeated):
        lost = counted
    used_hz = rate_hz or measured_hz
    faults += [losses_in_words(lost, used_hz)] if lost else []
    if back:
        row, by_s = min(back, key=lambda one: one[1])
        faults.append(
            f"{subject} steps back {len(back)} time{'s' * (len(back) > 1)}, the furthest by {-by_s:.4g} s at sample "
            f"{row + 1}; samples are counted on"
        )
    knots, offsets_s = _offsets(times_s, back, lost, used_hz)
    if float(np.abs(offsets_s).max(initial=0.0)) < 0.25 * step_s:
        offsets_s = np.zeros_like(offsets_s)
    return Timing(used_hz, repeated, lost, knots, offsets_s, faults)


def losses_in_words(lost: list[tuple[int, int]], rate_hz: float | None) -> str:
    """Return losses in a sentence, as a live source reports them."""
    longest = max(n for _, n in lost)
    gaps = "gap" if len(lost) == 1 else "gaps"
    how_long = f"{1000 * longest / rate_hz:.0f} ms" if rate_hz else f"{longest} samples"
    return f"{sum(n for _, n in lost)} samples were lost in {len(lost)} {gaps}, the longest {how_long}"


def _repeated(times_s: NDArray[np.float64], samples: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the rows that repeat the one before: samples that share a stamp, though they differ, are a batch."""
    same = np.flatnonzero(np.diff(times_s) == 0) + 1
    equal = [
        ((samples[part] == samples[part - 1]) | (np.isnan(samples[part]) & np.isnan(samples[part - 1]))).all(
            axis=1
        )
        for part in np.array_split(same, 1 + len(same) // _BLOCK)  # so that little more memory is taken
    ]
    rows: NDArray[np.int64] = same[np.concatenate(equal)]
    return rows if len(rows) >= 0.9 * len(same) else rows[:0]


def _jumps(
    times_s: NDArray[np.float64], step_s: float, *, subject: str, file: str
) -> tuple[list[tuple[int, float]], list[tuple[int, float]]]:
    """Return the rows before which time jumps ahead of an even course for good, and where it steps back.

    Each comes with the jump in seconds.
    """
    rows = _stamped(times_s)
    n_near, begin = max(4, min(_NEAR, len(rows) // 8)), 0
    rises, back = list[tuple[int, float]](), list[tuple[int, float]]()
    ahead_s = np.diff(times_s[rows]) - step_s * np.diff(rows)
    for k in (np.flatnonzero((ahead_s > 0.5 * step_s) | (ahead_s < -1.5 * step_s)) + 1).tolist():
        first, last = max(begin, k - n_near), min(len(rows), k + n_near)
        near = rows[first:last]
        late_s = times_s[near] - step_s * near
        # A sample cannot be stamped before it was taken: the earliest stamps on either side are compared.
        rise_s = float(late_s[k - first :].min() - late_s[: k - first].min())
        row, ahead = int(rows[k]), times_s[rows[k]] > times_s[rows[k] - 1]
        if rise_s > MOST_GAP_S:
            raise RecordingError(
                f"{file}: {subject} jumps by {rise_s / 3600:.3g} h between samples {row} and {row + 1}",
                "cut the file there, or set time to none to ignore its times",
            )
        if ahead and rise_s > 0.75 * step_s:
            rises.append((row, rise_s))
            begin = k
        elif not ahead and float(late_s[k - first :].max() - late_s[: k - first].min()) < -0.5 * step_s:
            back.append((row, rise_s))
            begin = k
    return rises, back


def _even_step(
    times_s: NDArray[np.float64], step_s: float, rises: list[tuple[int, float]], back: list[tuple[int, float]]
) -> float:
    edges = np.array([0, *sorted(row for row, _ in (*rises, *back)), len(times_s)])
    longest = int(np.diff(edges).argmax())
    part = times_s[edges[longest] : edges[longest + 1]]
    found = slope_of(part) if len(part) > _FEWEST else None
    return found if found is not None and abs(found / step_s - 1) < RATE_TOLERANCE else step_s


# Beyond it a float64 does not hold every whole number.
_MOST_COUNTED = 2.0**53


def lost_by_counter(counter: NDArray[np.float64]) -> list[tuple[int, int]]:
    """Return the losses that a counter shows, as :attr:`Timing.lost`; none for one that proves nothing.

    Example:
        >>> lost_by_counter(np.delete(np.arange(1000) % 256.0, slice(300, 340)))
        [(300, 40)]
    """
    if len(counter) < _FEWEST or not (np.abs(counter) <= _MOST_COUNTED).all():
        return []
    steps = np.diff(counter)
    step = float(np.median(steps))
    if step < 1 or (steps == step).mean() < 0.9:
        return []
    turn = float(counter.max() - counter.min()) + step
    odd = np.flatnonzero(steps != step)
    ahead = np.where(steps[odd] < 0, steps[odd] + turn, steps[odd])
    n_lost = np.round(ahead / step - 1).astype(np.int64)
    if (steps[odd] < 0).any() and turn > _MOST_TURN:
        return []
    return [(int(k) + 1, int(n)) for k, n in zip(odd, n_lost, strict=True) if n > 0]


def _offsets(
    times_s: NDArray[np.float64], back: list[tuple[int, float]], lost: list[tuple[int, int]], rate_hz: float
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the median lateness of each second, at its middle."""
    n_second = max(_FEWEST, round(rate_hz))
    edges = np.arange(0, len(times_s), n_second)
    shifts_s, rows_lost = np.zeros(len(edges)), np.zeros(len(edges))
    for row, by_s in back:
        shifts_s[edges >= row] += by_s
    for row, n in lost:
        rows_lost[edges >= row] += n
    medians = np.empty(len(edges))
    inside = {int(row) // n_second for row, _ in (*back, *lost)}
    for k, edge in enumerate(edges.tolist()):
        rows = np.arange(edge, min(edge + n_second, len(times_s)), dtype=np.float64)
        late_s = times_s[edge : edge + n_second] - times_s[0] - (rows + rows_lost[k]) / rate_hz - shifts_s[k]
        if k in inside:
            for row, by_s in back:
                late_s[max(0, row - edge) :] -= by_s if edge < row < edge + n_second else 0.0
            for row, n in lost:
                late_s[max(0, row - edge) :] -= n / rate_hz if edge < row < edge + n_second else 0.0
        medians[k] = np.median(late_s)
    knots = np.minimum(edges + n_second / 2, len(times_s) - 1)
    if len(knots) > 2:  # the last second may be a part of one; the ends go on as their neighbours do
        knots, medians = knots[:-1], medians[:-1]
        slopes = np.diff(medians)[[0, -1]] / np.diff(knots)[[0, -1]]
        ends = np.array([0.0, len(times_s) - 1.0])
        medians = np.r_[
            medians[0] - slopes[0] * knots[0], medians, medians[-1] + slopes[1] * (ends[1] - knots[-1])
        ]
        knots = np.r_[ends[0], knots, ends[1]]
    return knots, medians - medians[:1]


def _continued(times_s: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return times that go on after midnight, those that are missing evenly between their neighbours."""
    good, rows = np.isfinite(times_s), np.arange(len(times_s))
    if good.any() and not good.all():
        times_s = np.interp(rows, rows[good], times_s[good])
    days = np.abs(np.diff(times_s) + _DAY_S) < 60
    return times_s + np.r_[0.0, np.cumsum(days) * _DAY_S] if days.any() else times_s


def _round_rate(rate_hz: float, stated_hz: float | None) -> float:
    """Return a rate as it is stated or a whole number, where it is that within two in ten thousand."""
    for nice in (stated_hz, float(round(rate_hz))):
        if nice and abs(rate_hz / nice - 1) < 2e-4:
            return nice
    return float(f"{rate_hz:.6g}")
