"""Decode EMG by the paper's rules (Eq 10 to 13)."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, ClassVar, Final, Literal

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.emg import Fusion, GraspIntent
from tega.emg.levels import hold_last
from tega.errors import InvalidValueError
from tega.records import Intent
from tega.runtime.lifecycle import require
from tega.stages.base import Decoder, MuscleSetup, StageOptions

_LOW_HZ: Final = 20.0
_HIGH_HZ: Final = 450.0
_HIGHEST_SHARE: Final = 0.45
_ORDER: Final = 4
_MAINS_HZ: Final = (50.0, 60.0)
_NOTCH_Q: Final = 30.0


class EmgBand:
    """Band-pass of order 4 from 20 to 450 Hz and a notch at 50 and at 60 Hz, sample by sample.

    The band is LibEMG's for surface EMG. Filtering in chunks gives the same result as filtering the whole
    signal. The offset at the beginning, and its jump over 100 ms without a good sample, make no transient.
    It needs SciPy, and more than 267 samples a second (else ``InvalidValueError``).
    """

    def __init__(self, rate_hz: float, n_channels: int) -> None:
        signal = require("scipy.signal", driver="rules", extra="learn")
        high_hz = min(_HIGH_HZ, _HIGHEST_SHARE * rate_hz)
        if high_hz <= 2 * max(_MAINS_HZ):
            raise InvalidValueError(
                f'before = "band" needs more than {2 * max(_MAINS_HZ) / _HIGHEST_SHARE:.0f} samples a second, '
                f"the source has {rate_hz:g}",
                'leave before = "nothing"',
            )
        parts = [signal.butter(_ORDER, (_LOW_HZ, high_hz), "bandpass", fs=rate_hz, output="sos")]
        parts += [signal.tf2sos(*signal.iirnotch(hz, _NOTCH_Q, fs=rate_hz)) for hz in _MAINS_HZ]
        self._sections: NDArray[np.float64] = np.concatenate(parts)
        self._filter = signal.sosfilt
        self._state = np.zeros((len(self._sections), 2, n_channels))
        self._gap = math.ceil(0.1 * rate_hz)
        self._last, self._offset = np.zeros(n_channels), np.zeros(n_channels)
        self._missing = np.full(n_channels, self._gap)

    def take(self, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        """Filter (n, channels); pass on a sample that is no number, and give the filter the one before."""
        if not len(samples):
            return samples
        known = np.abs(samples) <= 1e300
        held, rows = hold_last(samples, known, self._last)
        # Samples missing up to each, those of earlier calls included.
        missing = np.arange(len(held))[:, None] - rows + np.where(rows, 0, self._missing)
        jumps = np.where(known & (missing[:-1] >= self._gap), np.diff(held, axis=0), 0.0)
        offsets = np.cumsum(np.vstack([self._offset, jumps]), axis=0)
        self._last, self._missing, self._offset = held[-1], missing[-1], offsets[-1]
        # The band lets no constant through: without its jumps the offset leaves nothing.
        filtered, self._state = self._filter(self._sections, (held - offsets)[1:], axis=0, zi=self._state)
        return np.where(known, filtered, samples)


class RulesOptions(StageOptions, frozen=True):
    """Options of the decoder ``rules``.

    Attributes:
        tau_s: τ of Eq 10, the length of a block; a calibration holds for its own τ.
        cutoff_hz: Cutoff of Eq 10's low-pass; the maxima stay those found behind the printed 50 Hz.
        order: Order of that low-pass.
        intervals: Equal intervals of Eq 11: 4 as printed, or 5, with level 5 from four fifths of the maximum on.
        fusion: ``floor``: Eq 12 and 13 as printed; ``round``: the mean to the nearest level; ``median``: no vote.
        channel_weights: Weight of each channel in the fusion, in the source's order; none means equal weights.
        before: Filter of the raw signal: nothing as printed, or the ``band`` of surface EMG, 20 to 450 Hz (or 0.45 of
            the rate) without mains at 50 and 60 Hz. Needs the extra ``learn``; the maxima stay those without.
        preset: ``paper``: nothing but the equations; ``live``: maxima times 0.8, steadied; none means the session's.
    """

    tau_s: Annotated[float, msgspec.Meta(ge=0.005, le=2)] = 0.1
    cutoff_hz: Annotated[float, msgspec.Meta(gt=0, le=2000)] = 50.0
    order: Annotated[int, msgspec.Meta(ge=1, le=8)] = 4
    intervals: Literal[4, 5] = 4
    fusion: Fusion = "floor"
    channel_weights: tuple[Annotated[float, msgspec.Meta(ge=0, le=1000)], ...] = ()
    before: Literal["nothing", "band"] = "nothing"
    preset: Literal["paper", "live"] | None = None


class RulesDecoder(Decoder):
    """Low-pass, block mean, a level a channel, vote: :class:`tega.emg.GraspIntent`.

    Raises ``InvalidValueError`` if rate or channels do not fit, ``CalibrationError`` for unusable maxima.
    """

    summary: ClassVar[str] = "levels by the paper's rules (Eq 10 to 13)"
    options_type: ClassVar[type[StageOptions]] = RulesOptions

    def __init__(self, setup: MuscleSetup, options: RulesOptions) -> None:
        if options.channel_weights and len(options.channel_weights) != len(setup.channels):
            raise InvalidValueError(
                f"channel_weights has {len(options.channel_weights)} numbers for {len(setup.channels)} channels",
                f"give one for each of {', '.join(setup.channels)}",
            )
        self._band = None
        if options.before == "band":
            if setup.kind != "raw":
                raise InvalidValueError(
                    f'before = "band" is for raw EMG, and this is {setup.kind}', 'leave before = "nothing"'
                )
            self._band = EmgBand(setup.rate_hz, len(setup.channels))
        self._intent = GraspIntent(
            setup.rate_hz,
            setup.maxima,
            tau=setup.block,
            kind=setup.kind,
            preset=options.preset or setup.preset,
            cutoff_hz=options.cutoff_hz,
            order=options.order,
            intervals=options.intervals,
            fusion=options.fusion,
            weights=options.channel_weights or None,
        )
        self._tau = setup.block
        self._n_waiting = 0

    @classmethod
    def block_s(cls, options: StageOptions) -> float:
        """Return τ, seconds."""
        assert isinstance(options, RulesOptions)
        return options.tau_s

    def decode(self, samples: NDArray[np.float64], times_ns: NDArray[np.int64]) -> Sequence[Intent]:
        """Take the next samples; one intent a block."""
        fused = self._intent.process(samples if self._band is None else self._band.take(samples))
        first = self._tau - self._n_waiting - 1
        self._n_waiting = (self._n_waiting + len(samples)) % self._tau
        if not len(fused):
            return []
        ends = slice(first, None, self._tau)
        rows = zip(times_ns[ends].tolist(), self._intent.levels.tolist(), fused.tolist(), strict=True)
        return [Intent(t_ns=t_ns, level=level, channels=tuple(channels)) for t_ns, channels, level in rows]

    @property
    def held_samples(self) -> Sequence[int]:
        """Samples replaced so far, by channel."""
        return [int(n) for n in self._intent.held_samples]

    @property
    def full_scale(self) -> Sequence[float]:
        """Maxima in use, by channel; ``live`` has scaled them."""
        return [float(maximum) for maximum in self._intent.maxima]
