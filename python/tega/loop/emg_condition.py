"""Watch the condition of muscles and electrodes: fatigue by the median frequency, moved electrodes by their pattern.

Both are evaluated once a second, on the seconds in which a muscle works. A tired muscle's spectrum moves down, and goes
on falling. An electrode that has moved measures another muscle, so the effort is distributed over the channels
differently. The findings are reported and recorded only; they depend only on the samples, however these are cut.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from typing import Final

import numpy as np
from numpy import fft  # it would else be imported by the first look, in the middle of a run
from numpy.typing import NDArray

from tega.config import SessionConfig
from tega.config.calibration import EmgMaxima
from tega.devices.base import EmgChunk
from tega.loop.inbox.inputs import Prepared
from tega.loop.inbox.sources import chunk_of
from tega.records import EmgSamples, MuscleCondition
from tega.records.bus import Backlog, Bus
from tega.runtime.threads import run_realtime

FELL_SHARE: Final = 0.15
"""Drop of a median frequency that is reported, as a share of its value in the run's first 20 s of effort."""
SLOPE_PERCENT_PER_MIN: Final = -1.0
"""And it has to fall by more than this."""
MOVED: Final = 0.35
"""Change of pattern from which electrodes are reported as moved."""
LOWEST_RATE_HZ: Final = 400.0
"""Lowest sample rate for fatigue: below it the spectrum of EMG is cut off, so no median frequency is reported."""
_EFFORT = 0.15
_BAND_HZ = (20.0, 450.0)
_FIRST_S = 20
_NEWEST_S = 10
# A weak effort is shared among the muscles otherwise than a strong one: each is compared with its own kind.
_STRONG = 0.3
_FIRST_PATTERNS_S, _PATTERNS_S = 8, 5
_MOST_S = 300
_MOST_CHUNKS = 4096


def median_frequency(samples: NDArray[np.float64], rate_hz: float) -> NDArray[np.float64]:
    """Return the frequency that halves the power of each channel from 20 to 450 Hz, (channels,); NaN for none.

    ``samples`` are float64 (n, channels), all of them numbers.

    Example:
        >>> at_s = np.arange(1000) / 1000
        >>> median_frequency(np.sin(2 * np.pi * 80 * at_s)[:, np.newaxis], 1000.0).round()
        array([80.])
    """
    centred = (samples - samples.mean(axis=0)) * np.hanning(len(samples))[:, np.newaxis]
    hz = fft.rfftfreq(len(samples), 1 / rate_hz)
    inside = (hz >= _BAND_HZ[0]) & (hz <= min(_BAND_HZ[1], 0.45 * rate_hz))
    power = np.cumsum(np.abs(fft.rfft(centred, axis=0)[inside]) ** 2, axis=0)
    found = np.full(samples.shape[1], np.nan)
    for k in np.flatnonzero(power[-1] > 0):
        found[k] = hz[inside][np.searchsorted(power[:, k], power[-1, k] / 2)]
    return found


class ConditionWatch:
    """Watches one source as its samples come."""

    def __init__(self, maxima: EmgMaxima) -> None:
        self._names, self._full = maxima.channels, np.array(maxima.maxima)
        self._raw, self._rate_hz = maxima.kind == "raw", maxima.rate_hz
        self._n_window = max(2, round(maxima.rate_hz))
        self._waiting = np.empty((0, len(self._names)))
        self._n_samples = self._next_index = 0
        self._frequencies: list[deque[tuple[float, float]]] = [deque(maxlen=_MOST_S) for _ in self._names]
        self._first: list[list[float]] = [[] for _ in self._names]
        self._patterns: dict[bool, deque[NDArray[np.float64]]] = {
            strong: deque(maxlen=_FIRST_PATTERNS_S) for strong in (False, True)
        }
        self._usual: dict[bool, NDArray[np.float64] | None] = {False: None, True: None}

    def take(self, chunk: EmgChunk) -> list[MuscleCondition]:
        """Take samples; return the condition after each second of effort in which no sample is missing."""
        found, samples = [], chunk.samples
        if chunk.first_index > self._next_index:
            self._waiting = self._waiting[:0]
            self._n_samples += chunk.first_index - self._next_index
        self._next_index = chunk.first_index + len(samples)
        while len(samples):
            part, samples = np.split(samples, [self._n_window - len(self._waiting)])
            self._waiting = np.concatenate([self._waiting, part])
            self._n_samples += len(part)
            if len(self._waiting) == self._n_window:
                one, self._waiting = self._check(self._waiting, chunk.t_ns), self._waiting[:0]
                found += [] if one is None else [one]
        return found

    def _check(self, window: NDArray[np.float64], t_ns: int) -> MuscleCondition | None:
        if not (np.abs(window) < 1e100).all():
            return None
        away = np.abs(window - window.mean(axis=0)) if self._raw else window
        shares = np.maximum(away.mean(axis=0) / self._full, 0.0)
        works = shares >= _EFFORT
        if not works.any():
            return None
        median_hz = np.full(len(self._names), np.nan)
        if self._raw and self._rate_hz >= LOWEST_RATE_HZ:
            median_hz[works] = median_frequency(window[:, works], self._rate_hz)
        at_min = self._n_samples / self._rate_hz / 60
        for k in np.flatnonzero(np.isfinite(median_hz)):
            self._frequencies[k].append((at_min, float(median_hz[k])))
            if len(self._first[k]) < _FIRST_S:
                self._first[k].append(float(median_hz[k]))
        slopes = [self._slope(k) for k in range(len(self._names))]
        change, sentences = self._pattern_change(shares), self._tired(slopes)
        if change > MOVED:  # NaN is not
            sentences.append(
                "electrodes have moved or come loose: refresh the calibration (calibrate --only emg --refresh)"
            )
        return MuscleCondition(
            t_ns=t_ns,
            median_hz=tuple(median_hz.tolist()),
            slope_percent_per_min=tuple(slopes),
            pattern_change=change,
            said="; ".join(sentences),
        )

    def _slope(self, k: int) -> float:
        """Return the slope of a channel's median frequency: the middle of those of pairs half a course apart."""
        seen = np.array(self._frequencies[k])
        half = len(seen) // 2
        if len(self._first[k]) < _FIRST_S or len(seen) < 2 * _FIRST_S:
            return math.nan
        steps = seen[half : 2 * half] - seen[:half]
        return float(np.median(steps[:, 1] / steps[:, 0]) / np.median(self._first[k]) * 100)

    def _tired(self, slopes: Sequence[float]) -> list[str]:
        sentences = []
        for name, slope, first, seen in zip(self._names, slopes, self._first, self._frequencies, strict=True):
            if not slope < SLOPE_PERCENT_PER_MIN:  # NaN is not either
                continue
            newest = [hz for _, hz in list(seen)[-_NEWEST_S:]]
            fell = 1 - float(np.median(newest) / np.median(first))
            if fell >= FELL_SHARE:
                sentences.append(
                    f"{name}: tired: its median frequency fell by {100 * fell:.0f} %; let the arm rest"
                )
        return sentences

    def _pattern_change(self, shares: NDArray[np.float64]) -> float:
        """Return how far the channels' shares are from the usual ones, 0 to 1: half the sum of the differences."""
        if len(self._names) < 2:
            return math.nan
        strong = bool(shares.mean() >= _STRONG)
        patterns, usual = self._patterns[strong], self._usual[strong]
        patterns.append(shares / shares.sum())
        if usual is None:
            if len(patterns) == _FIRST_PATTERNS_S:
                self._usual[strong] = _middle(list(patterns))
                patterns.clear()
            return math.nan
        if len(patterns) < _PATTERNS_S:
            return math.nan
        now = _middle(list(patterns)[-_PATTERNS_S:])
        return float(np.abs(now - usual).sum() / 2)


def _middle(patterns: Sequence[NDArray[np.float64]]) -> NDArray[np.float64]:
    middle = np.median(patterns, axis=0)
    found: NDArray[np.float64] = middle / middle.sum()
    return found


def open_condition(
    stack: ExitStack, config: SessionConfig, prepared: Prepared, bus: Bus
) -> Callable[[], str]:
    """Watch the muscles of a run, unless their samples are decoded somewhere else; publish their condition.

    The function returned gives the current alert, ``""`` for none. In real time a thread, which the stack ends, does
    it, so that no spectrum delays a source.
    """
    said, muscles, backlog = "", prepared.muscles, None
    if muscles is None or muscles.decoder is None:
        return lambda: ""
    watch = ConditionWatch(muscles.maxima)

    def take(given: EmgSamples) -> None:
        nonlocal said
        for condition in watch.take(chunk_of(given)):
            said = f"emg: {condition.said}" if condition.said else ""
            bus.publish(condition)

    if config.session.pace == "real":
        backlog = Backlog("condition", most=_MOST_CHUNKS, rank=run_realtime("beside"))
        stack.callback(backlog.close)
    bus.subscribe(EmgSamples, take, name="condition of the muscles", backlog=backlog)
    return lambda: said
