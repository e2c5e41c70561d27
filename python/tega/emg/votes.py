"""Take the vote from EMG channels that measure no muscle: stuck at one value, or nearly all mains.

The check is causal and a function of the samples alone, however they are cut into chunks, so that a replay takes the
same votes. It checks the end of every hop, a part of a block no longer than 25 ms (or the whole block if no such part
divides it). It passes its input on, with the samples of a faulty channel set to infinity: a decoder takes an infinite
sample for a channel without a vote (:meth:`tega.stages.Decoder.decode`).

=========  ============================================================  =========================================
fault      rule                                                          why there
=========  ============================================================  =========================================
stuck      raw: 0.1 s and 16 samples without any change                  recordings of people: 9 samples at most
stuck      rectified, envelope: 0.5 s at a value above level 1           at rest a coarse converter may stand still
mains      raw: 92 % of the power of 0.2 s at 50 or 60 Hz and multiples  recordings of people: 86 % at most
=========  ============================================================  =========================================

Mains interference below a tenth of the channel's maximum moves nothing and is ignored; between a half and 92 % the
health check reports it (:mod:`tega.devices.emg.emg_health`). A vote comes back after half a second without a fault.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from tega import _native
from tega.emg.levels import InputKind
from tega.errors import ShapeError
from tega.runtime.leading_axes import as_array

_HOP_S = 0.025
_STUCK_S = 0.1
_STUCK_ENVELOPE_S = 0.5
_FEWEST_STUCK = 16
_STILL_S = 0.02
_FEWEST_STILL = 5
_MAINS_S = 0.2
_MAINS_SHARE = 0.92
_MAINS_LEVEL = 0.1
_LINES_HZ = (50.0, 60.0)
# Mean of a rectified sine over its root mean square, 2·√2/π.
_MEAN_OF_RMS = 0.9
_BACK_S = 0.5


class ChannelVotes:
    """Judges the channels of one source as its samples come.

    ``block`` is the number of samples in a block of the decoder, ``maxima`` the block mean of each channel at
    maximum effort, in the unit of the samples. ``faults`` are the current ones, by channel, in words; replaced by
    a new dictionary at each change.

    Example:
        >>> votes = ChannelVotes(200, 20, "raw", ["ch1", "ch2"], [40.0, 40.0])
        >>> noise = np.random.default_rng(1).normal(0, 20, (40, 2))
        >>> bool(np.isfinite(votes.take(noise)).all()), votes.faults
        (True, {})
        >>> stuck = noise.copy()
        >>> stuck[:, 0] = 127
        >>> votes.take(stuck)[-1, 0], votes.faults["ch1"]
        (np.float64(inf), 'stays at 127: electrode off, cable out, or amplifier saturated')
    """

    def __init__(
        self, rate_hz: float, block: int, kind: InputKind, channels: Sequence[str], maxima: Sequence[float]
    ) -> None:
        self._names, self._shape = tuple(channels), (len(channels),)
        raw, full = kind == "raw", np.asarray(maxima, np.float64)
        longest = max(1, int(_HOP_S * rate_hz))
        hop = max((n for n in range(1, longest + 1) if block % n == 0 and 2 * n > longest), default=block)
        self._core = _native.ChannelVotes(
            rate_hz,
            hop=hop,
            stuck=max(_FEWEST_STUCK, math.ceil((_STUCK_S if raw else _STUCK_ENVELOPE_S) * rate_hz)),
            stuck_from=[-math.inf if raw else value for value in (full / 4).tolist()],
            still=max(_FEWEST_STILL, math.ceil(_STILL_S * rate_hz)) if raw else 0,
            mains=round(_MAINS_S * rate_hz) if raw else 0,
            mains_share=_MAINS_SHARE,
            mains_rms=(_MAINS_LEVEL / _MEAN_OF_RMS * full).tolist(),
            lines_hz=_LINES_HZ,
            back=math.ceil(_BACK_S * rate_hz),
        )
        self.faults: dict[str, str] = {}

    @property
    def began(self) -> int | None:
        """Number of the first sample of the newest fault there is; ``None`` while there is none."""
        return self._core.began

    @property
    def still(self) -> bool:
        """Whether no channel has changed for 20 ms and 5 samples: raw EMG that may have been stuck since then."""
        return self._core.still

    @property
    def room(self) -> int:
        """Samples that are missing to the end of the hop, at which it judges."""
        return self._core.room

    def take(self, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        """Judge the next samples, (n, channels), NaN where samples are missing; they are not written into.

        Return the same, infinite from the end of the hop on at which a channel was found at fault.
        """
        if samples.shape[1:] != self._shape:
            raise ShapeError(f"samples have shape {samples.shape}, expected (n, {len(self._names)})")
        changed, passed = self._core.take(np.ascontiguousarray(as_array(samples), np.float64))
        if changed:
            faults = zip(self._names, self._core.faults, strict=True)
            self.faults = {name: _words(*fault) for name, fault in faults if fault is not None}
        return samples if passed is None else passed


def _words(subject: str, value: float) -> str:
    if subject == "stuck":
        return f"stays at {value:g}: electrode off, cable out, or amplifier saturated"
    return f"mostly {value:g} Hz mains: electrode or reference loose, or lifted off"
