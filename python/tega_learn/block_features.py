"""Compute EMG features of blocks by their names in the literature: MAV, WL, ZC, SSC, LOGVAR, AR.

A block is ``tau`` samples. Each feature is a number a channel and block (AR: four), see
:data:`FEATURES`.
Amplitudes (MAV, WL, LOGVAR) enter a model as logarithms above the floor at rest, so that a gain is an offset.
"""

from __future__ import annotations

from typing import Final, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega.emg import ButterworthLowpass, InputKind
from tega.emg.levels import hold_last
from tega.errors import DtypeError, InvalidValueError, ShapeError
from tega.runtime.leading_axes import as_array

FEATURES: Final[dict[str, str]] = {
    "MAV": "mean absolute value: mean |x|",
    "WL": "waveform length a sample: mean |x[n] - x[n-1]|",
    "ZC": "zero crossings: share of samples at which the sign changes",
    "SSC": "slope sign changes: share of samples at which the slope's sign changes",
    "LOGVAR": "log variance: ln(mean (x - mean x)^2)",
    "AR": "four autoregressive coefficients, by the Yule-Walker equations",
}
"""Meaning of each feature."""

AMPLITUDES: Final = ("MAV", "WL", "LOGVAR")
"""Features that grow with the signal; the others do not change with a channel's gain."""

AR_ORDER: Final = 4
HIGHPASS_HZ: Final = 20.0
_BAD_SHARE: Final = 0.5
_LARGEST: Final = 1e100  # squares of larger ones overflow


def n_values(features: tuple[str, ...], channels: int) -> int:
    """Return the number of values of a block."""
    return channels * sum(AR_ORDER if name == "AR" else 1 for name in features)


def amplitude_values(features: tuple[str, ...], channels: int) -> NDArray[np.bool_]:
    """Return which of a block's values are amplitudes, bool ``(values,)``."""
    widths = [n_values((name,), channels) for name in features]
    return np.repeat([name in AMPLITUDES for name in features], widths)


def as_samples(samples: ArrayLike, channels: int | None) -> NDArray[np.float64]:
    """Return real samples as float64 ``(n, channels)``; ``None`` takes any number of channels."""
    array = as_array(samples)
    if array.dtype.kind not in "fiu":
        raise DtypeError(f"samples are {array.dtype}, expected float64", "give real numbers")
    if array.ndim == 1 and channels in {1, None}:
        array = array[:, np.newaxis]
    if array.ndim != 2 or (channels is not None and array.shape[1] != channels):
        raise ShapeError(f"samples have shape {array.shape}, expected (n, {channels or 'channels'})")
    return np.ascontiguousarray(array, np.float64)


class FeatureBlock(NamedTuple):
    """Samples of one block, ``(tau, channels)``, without offset where the kind is raw, and its bad channels.

    ``end`` is the number of its last sample among those of the call that completed it, never negative.
    """

    samples: NDArray[np.float64]
    bad: NDArray[np.bool_]
    end: int


class Blocks:
    """Cut EMG samples into blocks, without their offset; any chunks give the same blocks, bit for bit.

    Of the kind "raw" a 20 Hz high-pass removes the offset; "rectified" and "envelope" stay as they are. A
    sample that is NaN or infinite is replaced by the channel's last good one. A channel is bad in a block in
    which half of its samples or more were replaced, in the block after it (its filter settles), and, where
    the kind is raw, in a block in which it stands still: an amplifier at its limit, or a cable out.
    """

    def __init__(self, rate_hz: float, tau: int, kind: InputKind, channels: int) -> None:
        if kind not in {"raw", "rectified", "envelope"}:
            raise InvalidValueError(f"kind = {kind!r} is not known", "choose raw, rectified or envelope")
        if tau < 4:
            raise InvalidValueError(
                f"tau = {tau} samples is too short for a feature", "give at least 4 samples a block"
            )
        self._tau, self._channels, self._raw = tau, channels, kind == "raw"
        self._offset = ButterworthLowpass(rate_hz, HIGHPASS_HZ, 2, channels) if self._raw else None
        self._last = np.zeros(channels)
        self._waiting = np.empty((0, channels))
        self._waiting_raw = np.empty((0, channels))
        self._waiting_bad = np.empty((0, channels), bool)
        self._before = np.zeros(channels, bool)
        self.held_samples = np.zeros(channels, np.int64)

    def take(self, samples: ArrayLike) -> list[FeatureBlock]:
        """Take the next samples; return the blocks that they complete."""
        given = as_samples(samples, self._channels)
        if not len(given):
            return []
        good = np.abs(given) < _LARGEST  # not so for NaN
        if not good.all():
            self.held_samples += (~good).sum(axis=0)
            given = hold_last(given, good, self._last)[0][1:]
        self._last = given[-1].copy()
        n_before = len(self._waiting)
        if self._offset is not None:
            # What stands still is found in the samples as they came: the filter would ring on after them.
            flat = np.concatenate([self._waiting_raw, given]) if n_before else given
            filtered = given - self._offset.process(given)
        else:
            flat, filtered = given, given
        values = np.concatenate([self._waiting, filtered]) if n_before else filtered
        lost = np.concatenate([self._waiting_bad, ~good]) if n_before else ~good
        blocks = []
        tau = self._tau
        n_blocks = len(values) // tau
        for number in range(n_blocks):
            part = slice(number * tau, (number + 1) * tau)
            bad = lost[part].mean(axis=0) >= _BAD_SHARE
            if self._raw:
                bad |= np.ptp(flat[part], axis=0) == 0
            blocks.append(
                FeatureBlock(
                    np.ascontiguousarray(values[part]), bad | self._before, (number + 1) * tau - n_before - 1
                )
            )
            self._before = bad
        rest = n_blocks * tau
        self._waiting, self._waiting_bad = values[rest:].copy(), lost[rest:].copy()
        if self._offset is not None:
            self._waiting_raw = flat[rest:].copy()
        return blocks


def block_features(samples: NDArray[np.float64], features: tuple[str, ...]) -> NDArray[np.float64]:
    """Compute the features of one block.

    The samples are float64 ``(tau, channels)``, the features names out of :data:`FEATURES`. The result is float64
    ``(values,)``: feature by feature, the channels of each together; amplitudes are not yet logarithms, and LOGVAR is
    the variance.

    Example:
        >>> block_features(np.array([[1.0], [-1.0], [1.0], [-1.0]]), ("MAV", "WL", "ZC"))
        array([1., 2., 1.])
    """
    n = len(samples)
    found = []
    steps = samples[1:] - samples[:-1] if {"WL", "SSC"}.intersection(features) else samples
    for name in features:
        if name == "MAV":
            found.append(np.add.reduce(np.abs(samples)) / n)
        elif name == "WL":
            found.append(np.add.reduce(np.abs(steps)) / (n - 1))
        elif name == "LOGVAR":
            spread = samples - np.add.reduce(samples) / n
            found.append(np.add.reduce(spread * spread) / n)
        elif name == "ZC":
            found.append(np.add.reduce(samples[1:] * samples[:-1] < 0) / (n - 1))
        elif name == "SSC":
            found.append(np.add.reduce(steps[1:] * steps[:-1] < 0) / (n - 2))
        elif name == "AR":
            found += list(_autoregression(samples))
        else:
            raise InvalidValueError(f"feature {name!r} is not known", f"choose among {', '.join(FEATURES)}")
    return np.concatenate(found)


def _autoregression(samples: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the coefficients of every channel, ``(AR_ORDER, channels)``, by Levinson's recursion; 0 for silence."""
    n = len(samples)
    r = np.array([np.add.reduce(samples[k:] * samples[: n - k]) for k in range(AR_ORDER + 1)])
    error = np.where(r[0] > 0, r[0] * (1 + 1e-9), 1.0)
    a = np.zeros((AR_ORDER, r.shape[1]))
    for k in range(AR_ORDER):
        reflection = (r[k + 1] - np.add.reduce(a[:k] * r[k:0:-1])) / error
        a[:k], a[k] = a[:k] - reflection * a[:k][::-1], reflection
        error = error * (1 - reflection * reflection)
        error = np.where(error > 0, error, 1.0)
    return a
