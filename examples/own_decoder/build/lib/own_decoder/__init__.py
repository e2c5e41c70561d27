"""A decoder of one's own: the hand closes in proportion to one muscle's effort."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, ClassVar

import msgspec
import numpy as np

from tega.emg import ButterworthLowpass
from tega.errors import ConfigError
from tega.stages import Decoder, Intent, MuscleSetup, StageOptions

OFFSET_HZ = 20.0


class ProportionalOptions(StageOptions, frozen=True):
    """The keys of the decoder's ``options`` table.

    Attributes:
        channel: Which channel closes the hand, from 1.
        rest: Share of the channel's maximum up to which the hand stays open.
        full: Share of the maximum at which it is closed; above rest.
        smooth_hz: Cutoff of the envelope's low-pass.
        period_s: Time from one intent to the next.
    """

    channel: Annotated[int, msgspec.Meta(ge=1, le=64)] = 1
    rest: Annotated[float, msgspec.Meta(ge=0, lt=1)] = 0.1
    full: Annotated[float, msgspec.Meta(gt=0, le=2)] = 0.8
    smooth_hz: Annotated[float, msgspec.Meta(ge=0.5, le=20)] = 3.0
    period_s: Annotated[float, msgspec.Meta(ge=0.01, le=1)] = 0.02


class ProportionalDecoder(Decoder):
    """The envelope of one channel, between a rest and a full effort: closure 0 to 1."""

    summary: ClassVar[str] = "closure in proportion to one channel's effort"
    options_type: ClassVar[type[StageOptions]] = ProportionalOptions

    def __init__(self, setup: MuscleSetup, options: ProportionalOptions) -> None:
        if options.channel > len(setup.channels) or options.rest >= options.full:
            raise ConfigError(
                f"one-channel: channel {options.channel} of {len(setup.channels)}, rest {options.rest:g}, full "
                f"{options.full:g}",
                "name one of the channels, and a rest below full",
            )
        self._setup, self._options = setup, options
        # A sample that is NaN is replaced by the one before in the low-pass.
        self._offset = ButterworthLowpass(setup.rate_hz, OFFSET_HZ, 2, len(setup.channels))
        self._envelope = ButterworthLowpass(setup.rate_hz, options.smooth_hz, 2, len(setup.channels))
        self._period = max(1, round(options.period_s * setup.rate_hz))
        self._n = 0

    def decode(self, samples: np.ndarray, times_ns: np.ndarray) -> Sequence[Intent]:
        """Take the next samples; an intent every ``period_s``."""
        good = np.isfinite(samples)
        effort = samples
        if self._setup.kind == "raw":
            effort = np.abs(samples - self._offset.process(samples))
        shares = self._envelope.process(effort) / np.array(self._setup.maxima)
        ends = np.arange(-self._n % self._period - 1, len(samples), self._period)
        self._n += len(samples)
        return [self._intent(shares[end], good[end], int(times_ns[end])) for end in ends if end >= 0]

    def _intent(self, shares: np.ndarray, good: np.ndarray, t_ns: int) -> Intent:
        o, channel = self._options, self._options.channel - 1
        closure = float(np.clip((shares[channel] - o.rest) / (o.full - o.rest), 0.0, 1.0))
        levels = 1 + np.clip(np.floor(4 * np.nan_to_num(shares)), 0, 4).astype(int)
        return Intent(
            t_ns=t_ns,
            closure=closure,
            confidence=1.0 if good[channel] else 0.0,
            channels=tuple(int(level) if ok else 0 for level, ok in zip(levels, good, strict=True)),
            activity=tuple(float(np.clip(np.nan_to_num(share), 0, 1)) for share in shares),
        )
