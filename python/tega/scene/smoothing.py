"""Fit straight lines to what was measured in single pictures: smoothed courses with their errors."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

KERNEL_S: Final = 0.035
_NEAR_S: Final = 0.05


class Course(NamedTuple):
    """One measured quantity on a regular grid.

    Attributes:
        value: float64 (n,).
        slope: float64 (n,), per second.
        error: float64 (n,), standard error of the value.
    """

    value: NDArray[np.float64]
    slope: NDArray[np.float64]
    error: NDArray[np.float64]


def smoothed(
    t_s: NDArray[np.float64],
    values: NDArray[np.float64],
    errors: NDArray[np.float64],
    at_s: NDArray[np.float64],
) -> Course:
    """Fit a straight line about each moment, with Gaussian weights of 35 ms and by the values' errors.

    Where fewer than three values are near, the nearest ones to both sides are used.

    Args:
        t_s: (n,), rising, seconds.
        values: (n,); what is not a number is passed over.
        errors: (n,), standard errors.
        at_s: (m,), moments.
    """
    good = np.isfinite(values) & np.isfinite(errors)
    if good.sum() < 3:
        return Course(*np.full((3, len(at_s)), np.nan))
    t, y, sigma = t_s[good], values[good], np.maximum(errors[good], 1e-6)
    value, slope, error = np.empty((3, len(at_s)))
    for k, moment in enumerate(at_s):
        first, last = np.searchsorted(t, (moment - 3 * KERNEL_S, moment + 3 * KERNEL_S))
        kernel = KERNEL_S
        if last - first < 4:
            first, last = max(0, min(first, len(t) - 2) - 2), min(len(t), last + 2)
            kernel = max(kernel, float(np.abs(t[first:last] - moment).max()) / 2)
        x = t[first:last] - moment
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


def joined(
    t_s: NDArray[np.float64],
    values: NDArray[np.float64],
    errors: NDArray[np.float64],
    at_s: NDArray[np.float64],
) -> Course:
    """Join the values by straight lines; arguments as of :func:`smoothed`."""
    good = np.isfinite(values) & np.isfinite(errors)
    value = np.interp(at_s, t_s[good], values[good])
    return Course(value, np.gradient(value, at_s), np.interp(at_s, t_s[good], errors[good]))


def where_seen(seen_s: NDArray[np.float64], at_s: NDArray[np.float64], course: Course) -> Course:
    """Return a course without what is told of moments that are far from every sight."""
    if not len(seen_s):
        return course
    next_ = np.clip(np.searchsorted(seen_s, at_s), 1, max(1, len(seen_s) - 1))
    near = np.minimum(
        np.abs(at_s - seen_s[next_ - 1]), np.abs(at_s - seen_s[np.minimum(next_, len(seen_s) - 1)])
    )
    return course._replace(value=np.where(near <= _NEAR_S, course.value, np.nan))
