"""Take the closure from a decoder in another process, through the Lab Streaming Layer: the stage ``lsl``.

The other program receives the run's EMG (``markers.lsl_streams = ["emg"]``), or its own, and sends a closure from 0
to 1. The newest one is passed on with each block of the run's EMG, as long as it is recent enough by the sender's
stamps.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Annotated, Any, ClassVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.records import Intent
from tega.runtime.evidence import is_other_clock
from tega.stages.base import Decoder, MuscleSetup, StageOptions
from tega_lsl.library import EXTRA, ClockCorrection, connected, load_lsl

_NAME = "lsl"
_MOST_ROWS = 4096


class OutsideOptions(StageOptions, frozen=True):
    """Options of the decoder ``lsl``.

    Attributes:
        stream: Name of the stream: its first channel is the closure, 0 to 1, its second, if any, the confidence.
        age_ms: Older than this by its stamp, a closure is held and no channel is believed: the hand holds.
        start_s: Time to look for the stream.
        tau_s: Length of a block: so often the newest closure is passed on.
    """

    stream: str = "decoder"
    age_ms: Annotated[float, msgspec.Meta(ge=10, le=2000)] = 250.0
    start_s: Annotated[float, msgspec.Meta(gt=0, le=60)] = 5.0
    tau_s: Annotated[float, msgspec.Meta(ge=0.02, le=1)] = 0.05


class OutsideDecoder(Decoder):
    """Intents of a decoder that runs in another process.

    Its output cannot be computed again: a replay uses the recorded intents. Raises ``DeviceUnavailableError``
    if no stream of that name is on the network, or more than one, or it holds texts.
    """

    summary: ClassVar[str] = "closure by a decoder in another process, through an LSL stream"
    options_type: ClassVar[type[StageOptions]] = OutsideOptions
    requires: ClassVar[tuple[str, ...]] = ("pylsl",)
    extra: ClassVar[str] = EXTRA
    outside: ClassVar[bool] = True

    def __init__(self, setup: MuscleSetup, options: OutsideOptions) -> None:
        self._lsl = load_lsl(_NAME)
        self._options, self._maxima = options, np.array(setup.maxima)
        self._tau = max(1, round(options.tau_s * setup.rate_hz))
        self._waiting = np.empty((0, len(setup.channels)))
        self._closure, self._confidence, self._stamp_s = 0.0, 1.0, -math.inf
        self._is_other_clock = False
        self._inlet, self._correction = self._connected()

    @classmethod
    def block_s(cls, options: StageOptions) -> float:
        """Return the length of a block, seconds."""
        assert isinstance(options, OutsideOptions)
        return options.tau_s

    def decode(self, samples: NDArray[np.float64], times_ns: NDArray[np.int64]) -> Sequence[Intent]:
        """Take the next samples; one intent a block, with the newest closure that the other process has sent."""
        n_before = len(self._waiting)
        values = np.concatenate([self._waiting, samples])
        n_blocks = len(values) // self._tau
        self._waiting = values[n_blocks * self._tau :]
        if not n_blocks:
            return []
        self._receive()
        fresh = self.age_s <= self._options.age_ms / 1000
        return [
            self._intent(
                values[k * self._tau : (k + 1) * self._tau],
                int(times_ns[(k + 1) * self._tau - n_before - 1]),
                fresh=fresh,
            )
            for k in range(n_blocks)
        ]

    @property
    def age_s(self) -> float:
        """Age of the newest closure by its stamp, s; infinite before the first."""
        return float(self._lsl.local_clock()) - self._stamp_s

    @property
    def holds(self) -> str:
        """Reason why the newest closure is held; ``""`` if it is not."""
        age_s = self.age_s
        if self._is_other_clock:
            return "stamp: the other process stamps by another clock than lsl_local_clock()"
        if age_s <= self._options.age_ms / 1000:
            return ""
        return "the other process has said nothing" + (f" for {age_s:.1f} s" if age_s < math.inf else " yet")

    @property
    def full_scale(self) -> Sequence[float]:
        """Maxima of the calibration."""
        return tuple(self._maxima.tolist())

    def _intent(self, block: NDArray[np.float64], t_ns: int, *, fresh: bool) -> Intent:
        with np.errstate(invalid="ignore"):
            shares = np.abs(block - block.mean(axis=0)).mean(axis=0) / self._maxima
        good = np.isfinite(shares) & (shares < math.inf)
        levels = np.where(good, 1 + np.minimum(4 * np.where(good, shares, 0), 4).astype(int), 0)
        channels = tuple(levels.tolist()) if fresh else (0,) * len(levels)
        return Intent(
            t_ns=t_ns, closure=self._closure, confidence=self._confidence if fresh else 0.0, channels=channels
        )

    def _receive(self) -> None:
        """Take the received closures; one that is no number, or not from 0 to 1, is ignored."""
        if self._inlet is None:
            return
        try:
            rows, stamps_s = self._inlet.pull_chunk(timeout=0.0, max_samples=_MOST_ROWS)
            now_s, inlet = float(self._lsl.local_clock()), self._inlet
            correction_s = self._correction.follow(lambda: inlet.time_correction(timeout=0.001), now_s)
        except (self._lsl.util.LostError, RuntimeError):
            self._inlet = None  # the sender is gone: what it said last grows old
            return
        for row, stamp_s in zip(rows, stamps_s, strict=True):
            closure, confidence = float(row[0]), float(row[1]) if len(row) > 1 else 1.0
            at_s = float(stamp_s) + correction_s
            self._is_other_clock = math.isnan(at_s) or is_other_clock(now_s - at_s)
            if 0.0 <= closure <= 1.0 and 0.0 <= confidence <= 1.0 and not self._is_other_clock:
                self._closure, self._confidence, self._stamp_s = closure, confidence, at_s

    def _connected(self) -> tuple[Any, ClockCorrection]:
        o, lsl = self._options, self._lsl
        hints = (
            "start the other program first, or set stages.decoder.options.stream to its stream",
            "end the one that is not meant",
            "send the closure as a number",
        )
        inlet, first_s, _ = connected(
            lsl, "decoder 'lsl'", "name", o.stream, start_s=o.start_s, buffer_s=2, hints=hints
        )
        return inlet, ClockCorrection(o.stream, first_s, float(lsl.local_clock()))
