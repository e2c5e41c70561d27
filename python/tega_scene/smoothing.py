"""Fit smooth courses to the measurements of single frames, with their speeds and errors.

A straight line about each moment smears a sudden fall over the moments before it. Where the onset of a motion counts,
:func:`trended` fits pieces of parabolas with as few changes of acceleration as the errors allow (trend filtering of
second order: Kim, Koh, Boyd and Gorinevsky, *l1 Trend Filtering*, SIAM Review 51, 2009). Slow motion is then averaged
over long, and sudden motion stays sudden.
"""

from __future__ import annotations

from typing import Final, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from tega.runtime.lifecycle import require

Floats: TypeAlias = NDArray[np.float64]

KERNEL_S: Final = 0.035
_NEAR_S: Final = 0.05
_CHANGE_COST: Final = 30.0
"""What changes of acceleration cost against residuals. Chosen on simulated slips of other people than the proof has,
with errors of 0.1 to 0.3 mm a picture: 30 to 100 do as well, 3 and 1000 worse."""

_ROUNDS: Final = 25
_THIRD: Final = np.array([-1.0, 3.0, -3.0, 1.0])


class Course(NamedTuple):
    """One measured quantity on a regular grid, float64 (n,) each.

    ``slope`` is per second; ``error`` is the standard error of the value.
    """

    value: Floats
    slope: Floats
    error: Floats


def smoothed(t_s: Floats, values: Floats, errors: Floats, at_s: Floats) -> Course:
    """Fit a straight line about each moment, with Gaussian weights of 35 ms and by the values' errors.

    Where fewer than three values are near, the nearest ones to both sides are used. ``t_s``, rising,
    ``values``, of which NaN is skipped, and their standard ``errors`` are (n,); the moments ``at_s`` (m,).
    """
    good = np.isfinite(values) & np.isfinite(errors)
    if good.sum() < 3:
        return Course(*np.full((3, len(at_s)), np.nan))
    t, y, sigma = t_s[good], values[good], np.maximum(errors[good], 1e-6)
    value, slope, error = np.empty((3, len(at_s)))
    for k, snapshot in enumerate(at_s):
        first, last = np.searchsorted(t, (snapshot - 3 * KERNEL_S, snapshot + 3 * KERNEL_S))
        kernel = KERNEL_S
        if last - first < 4:
            first, last = max(0, min(first, len(t) - 2) - 2), min(len(t), last + 2)
            kernel = max(kernel, float(np.abs(t[first:last] - snapshot).max()) / 2)
        x = t[first:last] - snapshot
        weight = np.exp(-0.5 * (x / kernel) ** 2) / sigma[first:last] ** 2
        s0, s1, s2 = weight.sum(), weight @ x, weight @ x**2
        det = s0 * s2 - s1**2
        if det <= 1e-9 * s0 * s2:
            value[k], slope[k], error[k] = weight @ y[first:last] / s0, 0.0, sigma[first:last].mean()
            continue
        share = weight * (s2 - s1 * x) / det
        value[k] = share @ y[first:last]
        slope[k] = (weight * (s0 * x - s1)) @ y[first:last] / det
        error[k] = np.sqrt((share**2) @ sigma[first:last] ** 2)
    return Course(value, slope, error)


def trended(t_s: Floats, values: Floats, errors: Floats, at_s: Floats) -> Course:
    """Fit pieces of parabolas with few changes of acceleration.

    The minimised cost is half the sum of squared residuals over errors, plus a cost of the sum of the
    absolute third differences over the median error, by iteratively reweighted least squares. Errors that the
    residuals contradict are scaled up once. The error of the course is that of one frame, an upper bound.
    Arguments are as of :func:`smoothed`, but ``at_s`` must be in equal steps.
    """
    good = np.isfinite(values) & np.isfinite(errors)
    if good.sum() < 3 or len(at_s) < 4:
        return Course(*np.full((3, len(at_s)), np.nan))
    t, y, sigma = t_s[good], values[good], np.maximum(errors[good], 1e-6)
    value = _few_parabolas(t, y, sigma, at_s)
    # The median of what is normal is 0.67 of its standard deviation.
    off = float(np.median(np.abs(y - np.interp(t, at_s, value)) / sigma)) / 0.6745
    if off > 1:
        sigma = sigma * off
        value = _few_parabolas(t, y, sigma, at_s)
    return Course(value, np.gradient(value, at_s), np.interp(at_s, t, sigma))


def _few_parabolas(t: Floats, y: Floats, sigma: Floats, at_s: Floats) -> Floats:
    """Return the course at the moments, (m,)."""
    m = len(at_s)
    place = np.clip((t - at_s[0]) / (at_s[1] - at_s[0]), 0, m - 1 - 1e-9)
    first = place.astype(np.intp)
    late = place - first
    early, weight = 1 - late, 1 / sigma**2
    # Row i of a band has the normal matrix's entries (i, i), (i, i - 1), (i, i - 2), (i, i - 3).
    reported, right = np.zeros((m, 4)), np.zeros(m)
    np.add.at(reported[:, 0], first, weight * early**2)
    np.add.at(reported[:, 0], first + 1, weight * late**2)
    np.add.at(reported[:, 1], first + 1, weight * early * late)
    np.add.at(right, first, weight * early * y)
    np.add.at(right, first + 1, weight * late * y)
    usual = float(np.median(sigma))
    change = np.full(m - 3, usual / 20)
    value = np.zeros(m)
    for _ in range(_ROUNDS):
        cost = _CHANGE_COST / usual / np.maximum(np.abs(change), 1e-4 * usual)
        band = reported.copy()
        for i in range(4):
            for j in range(i + 1):
                band[i : m - 3 + i, i - j] += cost * _THIRD[i] * _THIRD[j]
        value = _solved(band, right)
        change = np.diff(value, 3)
    return value


def _solved(band: Floats, right: Floats) -> Floats:
    """Solve a symmetric system with three bands beside the diagonal."""
    m, both = len(right), np.zeros((7, len(right)))
    for k in range(4):
        both[3 + k, : m - k] = both[3 - k, k:] = band[k:, k]
    found: Floats = require("scipy.linalg", driver="scene", extra="lab").solve_banded((3, 3), both, right)
    return found


def joined(t_s: Floats, values: Floats, errors: Floats, at_s: Floats) -> Course:
    """Join the values by straight lines; arguments as of :func:`smoothed`."""
    good = np.isfinite(values) & np.isfinite(errors)
    value = np.interp(at_s, t_s[good], values[good])
    return Course(value, np.gradient(value, at_s), np.interp(at_s, t_s[good], errors[good]))


def where_seen(seen_s: Floats, at_s: Floats, course: Course) -> Course:
    """Return a course without the moments that are far from every observation."""
    if not len(seen_s):
        return course
    next_ = np.clip(np.searchsorted(seen_s, at_s), 1, max(1, len(seen_s) - 1))
    near = np.minimum(
        np.abs(at_s - seen_s[next_ - 1]), np.abs(at_s - seen_s[np.minimum(next_, len(seen_s) - 1)])
    )
    return course._replace(value=np.where(near <= _NEAR_S, course.value, np.nan))
