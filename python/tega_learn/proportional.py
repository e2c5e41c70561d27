"""Close the hand in proportion to the effort of one or two channels: the plain baseline."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega.emg import InputKind
from tega.errors import InvalidValueError, ShapeError
from tega.hand import nearest_level
from tega_learn.block_features import Blocks, FeatureBlock
from tega_learn.learned import BlockDecoder, Decoded

_LEVEL = 0.25
"""Closure of one level."""
_FARTHEST = 10.0


class ProportionalDecoder(BlockDecoder):
    """Mean absolute value of one channel, or of a closing less an opening one, between a dead band and full effort.

    closure = (share - dead_band) / (full - dead_band), clamped to 0..1; share = s_1 or s_1 - s_2, with s a channel's
    mean absolute value over its maximum, smoothed. Confidence is the chance that the closure is within one level of
    the one meant, by the scatter of the blocks about the smoothed drive: near 1 in a steady effort, less while it
    trembles or changes. It is 0 in a block in which a channel is bad: the closure is then held.

    Args:
        rate_hz: Samples per second.
        maxima: Mean absolute value at maximum effort, ``(channels,)``.
        tau: Samples per block.
        kind: "raw", "rectified" or "envelope".
        channels: Closing channel, and the opening one if two are given; counted from 0.
        dead_band: Share of the maximum up to which the hand stays open.
        full: Share at which it is closed.
        smoothing_s: Time constant of the causal smoothing, s.
    """

    def __init__(
        self,
        rate_hz: float,
        maxima: ArrayLike,
        *,
        tau: int,
        kind: InputKind = "raw",
        channels: Sequence[int] = (0,),
        dead_band: float = 0.1,
        full: float = 0.8,
        smoothing_s: float = 0.15,
    ) -> None:
        self._reported = f"{kind}, {rate_hz:g} Hz, closes by channel {', '.join(map(str, channels[:1]))}"
        self._maxima = np.atleast_1d(np.asarray(maxima, np.float64))
        if self._maxima.ndim != 1 or not (self._maxima > 0).all():
            raise ShapeError(f"maxima = {self._maxima}", "give a number above 0 for each channel")
        used = tuple(channels)
        if len(used) not in {1, 2} or not all(0 <= c < len(self._maxima) for c in used):
            raise InvalidValueError(
                f"channels = {used!r} of {len(self._maxima)}",
                "name one that closes, or that and one that opens",
            )
        if not 0 <= dead_band < full:
            raise InvalidValueError(
                f"dead_band = {dead_band!r}, full = {full!r}", "give 0 <= dead_band < full"
            )
        self._used, self._dead_band, self._full = list(used), dead_band, full
        self._gain = -float(np.expm1(-tau / rate_hz / smoothing_s))
        self._blocks = Blocks(rate_hz, tau, kind, len(self._maxima))
        self._state: NDArray[np.float64] | None = None
        self._last = self._confidence = 0.0
        # Of a block's drive less the smoothed one before it; half the gain of that is the smoothed one's own.
        self._variance = 0.0
        self.decoded = []

    def __repr__(self) -> str:
        """Samples, rate and closing channel."""
        return f"<ProportionalDecoder: {self._reported}>"

    def _decode(self, block: FeatureBlock) -> Decoded:
        bad = bool(block.bad[self._used].any())
        if not bad:
            shares = np.add.reduce(np.abs(block.samples)) / len(block.samples) / self._maxima
            before = shares if self._state is None else self._state
            away = min(abs(self._drive(shares - before)), _FARTHEST)
            self._state = before + self._gain * (shares - before)
            self._variance += self._gain * (away * away - self._variance)
            span = self._full - self._dead_band
            self._last = min(1.0, max(0.0, (self._drive(self._state) - self._dead_band) / span))
            deviation = math.sqrt(0.5 * self._gain * self._variance) / span
            self._confidence = math.erf(_LEVEL / deviation / math.sqrt(2.0)) if deviation > 0 else 1.0
        now = np.zeros(len(self._maxima)) if self._state is None else self._state
        levels = np.where(bad | block.bad, 0, 1 + np.minimum(4 * now, 4).astype(int))
        confidence, level = 0.0 if bad else self._confidence, nearest_level(self._last)
        return Decoded(self._last, level, confidence, bad, tuple(levels.tolist()), block.end)

    def _drive(self, shares: NDArray[np.float64]) -> float:
        """Return the share of the closing channel, less that of the opening one."""
        drive = float(shares[self._used[0]])
        return drive - float(shares[self._used[1]]) if len(self._used) == 2 else drive
