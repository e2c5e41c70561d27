"""Turn EMG samples into a closure level (Eq 10 to 13).

`GraspIntent` is the whole chain: low-pass, block means, a level from 1 (open) to 5 (closed) a channel, vote. State is
kept between calls: a recording gives bit-identical results however it is cut into chunks.

Samples are ``(n, channels)``, ``float64``, in any one unit, NaN or masked where missing. Other float and integer
arrays are converted (one copy), as is an array that is not C-contiguous; booleans, complex numbers and objects are a
``DtypeError``. One-dimensional samples are taken for one channel.

Example:
    >>> import numpy as np
    >>> t_s = np.arange(2000) / 1000
    >>> squeeze = 2048 + 300 * np.sign(np.sin(2 * np.pi * 100 * t_s))[:, None] * [1, 1, 1]
    >>> maxima = channel_maxima(squeeze, 1000, tau=100)
    >>> intent = GraspIntent(1000, maxima, tau=100)
    >>> intent.process(np.full((200, 3), 2048.0))
    array([1, 1])
    >>> intent.process(squeeze)[-1]
    np.int64(5)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal, cast, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega import _native
from tega.errors import DtypeError, ShapeError
from tega.runtime.leading_axes import as_array, each_item, each_number

InputKind = Literal["raw", "rectified", "envelope"]
"""Kind of a source's samples: EMG about an offset, EMG rectified by the sensor, or a sensor's envelope."""

Preset = Literal["paper", "live"]
"""The printed law, or the reading made for people."""

Fusion = Literal["floor", "round", "median"]
"""How the channels' levels become one: Eq 12 and 13, the same with the mean rounded, or the median without a vote."""


def _rows(samples: ArrayLike, channels: int | None) -> NDArray[np.float64]:
    array = as_array(samples)
    if array.dtype != np.float64 and (array.dtype.kind not in "fiu" or array.dtype.itemsize > 8):
        raise DtypeError(
            f"samples are {array.dtype}, expected float64",
            "give real numbers: floats or integers of at most 64 bits",
        )
    if array.ndim == 1 and channels in {1, None}:
        array = array[:, np.newaxis]
    if array.ndim != 2:
        raise ShapeError(f"samples have shape {array.shape}, expected (n, {channels or 'channels'})")
    return np.ascontiguousarray(array, np.float64)


def hold_last(
    samples: NDArray[np.float64], good: NDArray[np.bool_], last: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """Return ``last`` and the samples, each bad one replaced by its channel's last good one, and the rows of these."""
    numbers = np.arange(1, len(samples) + 1)[:, np.newaxis]
    rows = np.maximum.accumulate(
        np.vstack([np.zeros(len(last), np.int64), np.where(good, numbers, 0)]), axis=0
    )
    return np.take_along_axis(np.vstack([last, samples]), rows, axis=0), rows


class ButterworthLowpass:
    """A causal Butterworth low-pass that keeps its state between calls.

    Second-order sections in float64. Each channel starts settled on its first sample, so an offset makes no
    transient. A sample that is NaN or infinite is replaced by the channel's last good one and counted; after
    100 ms of them, or an infinite one, the channel starts afresh, settled, at its next good sample.

    Args:
        rate_hz: Sample rate, Hz.
        cutoff_hz: Frequency at which the gain is down by 3 dB, Hz.
        order: 1 to 8.
        channels: Number of channels, 1 to 1024.

    Raises:
        InvalidValueError: The rate is not positive, the order not 1 to 8, or the cutoff not inside
            (0, rate/2), or nearer to either end than 1e-6 of the rate, where rounding would spoil the filter.

    Example:
        >>> import numpy as np
        >>> lowpass = ButterworthLowpass(1000, channels=1)
        >>> bool(np.allclose(lowpass.process(np.full((5, 1), 2048.0)), 2048.0))
        True
    """

    def __init__(self, rate_hz: float, cutoff_hz: float = 50.0, order: int = 4, channels: int = 3) -> None:
        self._core = _native.ButterworthLowpass(rate_hz, cutoff_hz, order, channels)

    def process(self, samples: ArrayLike) -> NDArray[np.float64]:
        """Return the next samples filtered, ``(n, channels)``; ``ShapeError`` for another number of channels."""
        return self._core.process(_rows(samples, self._core.channels))

    @property
    def channels(self) -> int:
        """Number of channels."""
        return self._core.channels

    @property
    def sos(self) -> NDArray[np.float64]:
        """Sections as they run, ``(sections, 6)``: ``b0, b1, b2, 1, a1, a2``, as in `scipy.signal`."""
        return self._core.sos

    @property
    def held_samples(self) -> NDArray[np.uint64]:
        """Samples replaced so far, ``(channels,)``."""
        return self._core.held_samples


class BlockMean:
    """The mean of every ``tau`` samples of each channel (Eq 10); samples left over wait for the next call.

    The mean is right to the last digit whatever cancels within a block. A sample that is NaN or infinite is
    replaced by the channel's last good one (0 before the first) and counted.

    Args:
        tau: Samples per block, 1 to 10,000,000.
        channels: Number of channels; left out, the first call decides.

    Raises:
        InvalidValueError: ``tau`` or ``channels`` is out of range.

    Example:
        >>> BlockMean(2).process([1.0, 3.0, 5.0])
        array([[2.]])
    """

    def __init__(self, tau: int, channels: int | None = None) -> None:
        self._core = _native.BlockMean(tau, channels)

    def process(self, samples: ArrayLike) -> NDArray[np.float64]:
        """Take the next samples; return the means of the blocks completed, ``(k, channels)``, ``float64``.

        Raises:
            ShapeError: The samples have another number of channels.
            InvalidValueError: The first samples have no channel.
        """
        return self._core.process(_rows(samples, self._core.channels))

    @property
    def channels(self) -> int | None:
        """Number of channels, or None before the first call where it was left out."""
        return self._core.channels

    @property
    def held_samples(self) -> NDArray[np.uint64]:
        """Samples replaced so far, ``(channels,)``."""
        return self._core.held_samples


class GraspIntent:
    """EMG samples of several channels to one closure level per block of ``tau`` samples.

    ``kind`` is the kind of the samples. "raw" swings about an offset: a 20 Hz high-pass, settled on the first sample,
    removes it and the rest is full-wave rectified. "rectified" and "envelope" go straight into Eq 10's low-pass (50
    Hz, 4th order) and block mean.

    ``preset`` "paper" is the printed law: Eq 11 clamped to 1..5, Eq 12 and 13. "live" scales the maxima by
    0.8, steadies the channels' drives where effort is constant, moves a level 0.1 beyond its border and lets
    the fused level change once two blocks in a row are on the same side of it (four for a single step back
    against the change before).

    A sample that is NaN or infinite is replaced by the channel's last good one and counted. After 100 ms of them, or at
    once where it is infinite, the channel is bad and has no vote, until 100 ms of good samples have come. With every
    channel bad the last fused level is held, 1 if there was none.

    Args:
        rate_hz: Sample rate, Hz; above 100 Hz, which the low-pass needs.
        maxima: Block mean of each channel at maximum effort, ``(channels,)``, as `channel_maxima` gives it.
        tau: Samples per block.
        cutoff_hz: Cutoff of Eq 10's low-pass, Hz.
        order: Its order, 1 to 8.
        intervals: Into how many equal parts Eq 11 cuts the range up to the maximum: 4 as printed, or 5, with level 5
            from four fifths of it on.
        fusion: Rule for Eq 12 and 13: "floor" as printed, "round" with the mean rounded to the nearest level (a half
            upward), "median" of the levels (the lower of two) without a vote.
        weights: Weight of each channel in that rule, 0 or more, ``(channels,)``; ``None`` for equal weights.

    Raises:
        InvalidValueError: The rate, ``tau``, ``kind``, ``preset`` or a rule cannot be used.
        CalibrationError: A maximum is not finite or not greater than 0.
        ShapeError: ``maxima`` is not one-dimensional.

    Example:
        >>> import numpy as np
        >>> intent = GraspIntent(200, [1.0, 1.0, 2.0], tau=20, kind="envelope", preset="paper")
        >>> intent.process(np.full((40, 3), 0.6))
        array([3, 3])
        >>> intent.levels
        array([[3, 3, 2],
               [3, 3, 2]])
    """

    def __init__(
        self,
        rate_hz: float,
        maxima: ArrayLike,
        *,
        tau: int,
        kind: InputKind = "raw",
        preset: Preset = "live",
        cutoff_hz: float = 50.0,
        order: int = 4,
        intervals: Literal[4, 5] = 4,
        fusion: Fusion = "floor",
        weights: Sequence[float] | None = None,
    ) -> None:
        values = np.atleast_1d(np.asarray(as_array(maxima), np.float64))
        if values.ndim != 1:
            raise ShapeError(f"maxima have shape {values.shape}, expected (channels,)")
        self._core = _native.GraspIntent(
            rate_hz,
            values,
            tau,
            kind,
            preset,
            cutoff_hz=cutoff_hz,
            order=order,
            intervals=intervals,
            fusion=fusion,
            weights=None if weights is None else [float(w) for w in weights],
        )
        self._channels = len(values)
        self._reported = f"{kind}, {rate_hz:g} Hz, blocks of {tau}, preset {preset}"

    def __repr__(self) -> str:
        """Conditions and channels."""
        return f"<GraspIntent: {self._reported}, {self._channels} channel{'s' * (self._channels != 1)}>"

    def process(self, samples: ArrayLike) -> NDArray[np.int64]:
        """Return the fused level of each block that the next samples complete, 1 to 5, ``(k,)``, ``int64``.

        ``ShapeError`` for another number of channels.
        """
        return self._core.process(_rows(samples, self._channels))

    @property
    def channels(self) -> int:
        """Number of channels."""
        return self._channels

    @property
    def maxima(self) -> NDArray[np.float64]:
        """Maxima in use, ``(channels,)``; "live" has scaled them."""
        return self._core.maxima

    @property
    def levels(self) -> NDArray[np.int64]:
        """Level of each channel in the blocks of the last call, ``(k, channels)``; 0 where it had no vote."""
        return self._core.levels

    @property
    def bad_channels(self) -> tuple[int, ...]:
        """Channels that are bad now, counted from 0."""
        return self._core.bad_channels

    @property
    def held_samples(self) -> NDArray[np.uint64]:
        """Samples replaced so far, ``(channels,)``."""
        return self._core.held_samples

    @property
    def holding(self) -> bool:
        """Whether the last block only repeated the level before it because no channel had a vote."""
        return self._core.holding


@overload
def grasp_level(value: float, maximum: float) -> int: ...
@overload
def grasp_level(value: ArrayLike, maximum: ArrayLike) -> NDArray[np.int64]: ...
def grasp_level(value: ArrayLike, maximum: ArrayLike) -> int | NDArray[np.int64]:
    """Put a block mean on its level: ``⌊4 value / maximum + 1⌋`` clamped to 1..5 (Eq 11).

    A value of at least a border times (1 - 1e-9) counts as on it, to absorb the rounding of decimals.

    Args:
        value: Block mean; negative values and NaN are level 1, the open hand. Or an array of them.
        maximum: Block mean at maximum effort, in the same unit. Arrays are broadcast, such as (k, channels) against
            (channels,); the result is int64 of their common shape then.

    Raises:
        DtypeError: An array does not hold real numbers.
        InvalidValueError: The maximum is not finite or not greater than 0.

    Example:
        >>> grasp_level(0.00225, 0.003)
        4
        >>> grasp_level([[0.0, 1.0], [2.0, 3.0]], [4.0, 4.0])
        array([[1, 2],
               [3, 4]])
    """
    if isinstance(value, (np.ndarray, Sequence)) or isinstance(maximum, (np.ndarray, Sequence)):
        return each_number(_native.grasp_level, value, maximum, dtype=np.int64)
    return _native.grasp_level(cast("float", value), cast("float", maximum))


@overload
def fuse_levels(levels: Sequence[int]) -> int: ...
@overload
def fuse_levels(levels: NDArray[np.integer]) -> int | NDArray[np.int64]: ...
def fuse_levels(levels: Sequence[int] | NDArray[np.integer]) -> int | NDArray[np.int64]:
    """Fuse the channels' levels: the one most agree on (Eq 12), else their mean, rounded down (Eq 13).

    For any number of channels the level with the most votes wins; where several share them, the mean decides.
    ``levels`` are whole numbers 1 to 5, one a channel, else ``DtypeError`` or ``InvalidValueError``; for an array with
    leading axes, such as (k, channels), the result is int64 of those.

    Example:
        >>> fuse_levels([1, 2, 5])
        2
    """
    array = as_array(levels)
    if array.size and array.dtype.kind not in "iu":
        raise DtypeError(
            f"levels are {array.dtype}, expected whole numbers", "round them, or leave out missing ones"
        )
    if array.ndim > 1:
        fused = [_native.fuse_levels(array[index].tolist()) for index in np.ndindex(array.shape[:-1])]
        return np.array(fused, np.int64).reshape(array.shape[:-1])
    return _native.fuse_levels(array.tolist())


def channel_maxima(
    samples: ArrayLike,
    rate_hz: float,
    *,
    tau: int,
    kind: InputKind = "raw",
    percentile: float = 95.0,
) -> NDArray[np.float64]:
    """Calibrate each channel's maximum: a percentile of the block means of a strong contraction.

    The samples run through the same chain as in `GraspIntent`. The paper's maximum is the 100th percentile;
    the 95th does not hang on one block.

    Args:
        samples: The contraction, ``(n, channels)``. An array with leading axes, ``(..., n, channels)``, holds a
            contraction of its own in each place.
        rate_hz: Sample rate, Hz.
        tau: Samples per block.
        kind: "raw", "rectified" or "envelope".
        percentile: 0 to 100, linear between ranks.

    Returns:
        Maxima, ``(..., channels)``, ``float64``, in the unit of ``samples``.

    Raises:
        InvalidValueError: The rate, ``tau``, ``kind`` or ``percentile`` cannot be used.
        CalibrationError: A sample is not finite, there is no whole block, or a maximum is not above 0.

    Example:
        >>> import numpy as np
        >>> channel_maxima(np.full((400, 2), 0.5), 200, tau=20, kind="envelope").round(9)
        array([0.5, 0.5])
    """

    def maxima(rows: ArrayLike) -> NDArray[np.float64]:
        return _native.channel_maxima(_rows(rows, None), rate_hz, tau, kind, percentile)

    return each_item(maxima, as_array(samples), item_axes=2, kept=slice(-1, None), dtype=np.float64)
