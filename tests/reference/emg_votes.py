"""Judges EMG channels once more, in NumPy, its whole past moved for every chunk: what the program has to decide."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from tega.errors import ShapeError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega.emg import InputKind

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
    """Judges the channels of one source as :class:`tega.emg.votes.ChannelVotes` does.

    Mains are looked for in every window, not only where its halves are alike.
    """

    def __init__(
        self, rate_hz: float, block: int, kind: InputKind, channels: Sequence[str], maxima: Sequence[float]
    ) -> None:
        self._names, self._kind = tuple(channels), kind
        self._maxima = np.asarray(maxima, np.float64)
        longest = max(1, int(_HOP_S * rate_hz))
        self._hop = max(
            (n for n in range(1, longest + 1) if block % n == 0 and 2 * n > longest), default=block
        )
        stuck_s = _STUCK_S if kind == "raw" else _STUCK_ENVELOPE_S
        self._n_stuck = max(_FEWEST_STUCK, math.ceil(stuck_s * rate_hz))
        self._n_still = max(_FEWEST_STILL, math.ceil(_STILL_S * rate_hz))
        self._n_mains = round(_MAINS_S * rate_hz)
        self._lines = {line_hz: _comb(line_hz, rate_hz, self._n_mains) for line_hz in _LINES_HZ}
        self._n_back = math.ceil(_BACK_S * rate_hz)
        self._past = np.full((max(self._n_stuck, self._n_mains), len(self._names)), np.nan)
        self._n = 0
        self._faulty_until = np.zeros(len(self._names), np.int64)
        self._began: list[int | None] = [None] * len(self._names)
        self.faults: dict[str, str] = {}

    @property
    def began(self) -> int | None:
        """Number of the first sample of the newest fault there is; ``None`` while there is none."""
        return max((n for n in self._began if n is not None), default=None)

    @property
    def still(self) -> bool:
        """Whether no channel has changed for 20 ms and 5 samples: raw EMG that may have been stuck since then."""
        recent = self._past[-self._n_still :]
        return self._kind == "raw" and bool((recent == recent[-1]).all())

    @property
    def room(self) -> int:
        """Samples that are missing to the end of the hop, at which it judges."""
        return self._hop - self._n % self._hop

    def take(self, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        """Judge the next samples, float64 (n, channels), NaN where they are missing; they are not written into.

        They are returned, infinite from the end of the hop on at which a channel was found at fault.
        """
        if samples.shape[1:] != self._maxima.shape:
            raise ShapeError(f"samples have shape {samples.shape}, expected (n, {len(self._names)})")
        passed: NDArray[np.float64] | None = None
        at = 0
        while at < len(samples):
            part = samples[at : at + self.room]
            self._past = np.concatenate([self._past, part])[-len(self._past) :]
            self._n += len(part)
            if self._n % self._hop == 0:
                self._judge()
            if self.faults:
                if passed is None:
                    passed = samples.copy()
                passed[at : at + len(part), [name in self.faults for name in self._names]] = np.inf
            at += len(part)
        return samples if passed is None else passed

    def _judge(self) -> None:
        """Look at what came until now, the end of a hop."""
        found = {**self._mains(), **self._stuck()}
        for k, name in enumerate(self._names):
            if k in found:
                words, lasted = found[k]
                self._faulty_until[k] = self._n + self._n_back
                self.faults[name] = words
                if self._began[k] is None:
                    # At the end of the hop before, it was not seen yet.
                    self._began[k] = self._n - self._hop - lasted
            elif name in self.faults and self._n >= self._faulty_until[k]:
                del self.faults[name]
                self._began[k] = None

    def _stuck(self) -> dict[int, tuple[str, int]]:
        recent = self._past[-self._n_stuck :]
        # A missing sample is not equal to anything, itself included.
        still = (recent == recent[-1]).all(axis=0)
        if self._kind != "raw":
            still &= recent[-1] >= self._maxima / 4
        why = "electrode off, cable out, or amplifier saturated"
        return {int(k): (f"stays at {recent[-1, k]:g}: {why}", self._n_stuck) for k in still.nonzero()[0]}

    def _mains(self) -> dict[int, tuple[str, int]]:
        recent = self._past[-self._n_mains :]
        if self._kind != "raw":
            return {}
        swing = recent - recent.mean(axis=0)
        power = (swing**2).sum(axis=0)
        found: dict[int, tuple[str, int]] = {}
        # A line has no more power than the whole, so that at rest none is loud enough.
        may_be = _MEAN_OF_RMS * np.sqrt(power / len(recent)) >= _MAINS_LEVEL * self._maxima
        if not may_be.any():
            return found
        for line_hz, comb in self._lines.items():
            line = ((comb @ swing) ** 2).sum(axis=0)
            level = _MEAN_OF_RMS * np.sqrt(line / len(recent))
            # What is not a number is not greater.
            for k in ((line > _MAINS_SHARE * power) & (level >= _MAINS_LEVEL * self._maxima)).nonzero()[0]:
                words = f"mostly {line_hz:g} Hz mains: electrode or reference loose, or lifted off"
                found[int(k)] = (words, self._n_mains)
        return found


def _comb(line_hz: float, rate_hz: float, n: int) -> NDArray[np.float64]:
    """Return an orthonormal base of a frequency and its multiples below half the rate, without their mean, (m, n)."""
    turns = 2 * np.pi * np.arange(n) * line_hz / rate_hz
    multiples = range(1, math.ceil(rate_hz / 2 / line_hz))
    waves = [wave(k * turns) for k in multiples for wave in (np.cos, np.sin)]
    if not waves or 2 * len(waves) > n:
        return np.zeros((0, n))
    return np.ascontiguousarray(np.linalg.qr(np.array(waves).T)[0].T)
