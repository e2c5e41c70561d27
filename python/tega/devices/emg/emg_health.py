"""Find and describe EMG signal faults: gaps, saturation, mains, lift-off, repeats, bridges, swaps.

Everything is judged from the samples alone, half a second at a time (two seconds for mains and bridges). A finding
is kept with how long it lasted, since a summary is read afterwards.
"""

from __future__ import annotations

import itertools
from collections import Counter
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega.devices.base import EmgChunk

_POLL_S = 0.5
_SPECTRUM_S = 2.0

# Real squeezes are at the limits in up to 3.7 % of their samples; beyond 1 % the level reads too low.
CLIPPED_SHARE = 0.01
# More than half at the limits is no muscle: an open or saturated input.
RAILED_SHARE = 0.5
# A polled armband repeated 69 % of its rows; a converter's noise hardly repeats all channels at once.
REPEATED_SHARE = 0.5
# Taking a line out pays up to a signal-to-line ratio of about 9 dB (CleanEMG, 2011): 1/(1 + 10^0.9) of the power.
MAINS_SHARE = 0.11
# With more power in the line than in everything else the electrode works as an aerial.
LOOSE_SHARE = 0.5
# The line has to stand out of its neighbourhood, or it is muscle.
MAINS_PEAK = 10.0
# Raw signals of different muscles correlate less (the same limit stops a calibration).
BRIDGED_CORRELATION = 0.9
# Raw EMG crosses its mean at least twice per cycle of its lowest 20 Hz; an envelope hardly does.
RAW_CROSSINGS_PER_S = 20.0
# How many times better another order of the channels must fit before they are called swapped.
SWAPPED_RATIO = 1.5


class EmgHealth:
    """Looks at the samples of one source as they come.

    ``limits`` are the converter's, in the unit of the samples; ``None`` if unknown, and saturation is not detected.

    Example:
        >>> health = EmgHealth(200.0, ["ch1"], limits=(0.0, 1023.0))
        >>> health.take(EmgChunk(0, 0, np.full((100, 1), 1023.0)))
        >>> health.now
        ("ch1: at the converter's limit: electrode off, cable out, or amplifier saturated",)
    """

    def __init__(
        self, rate_hz: float, channels: Sequence[str], *, limits: tuple[float, float] | None = None
    ) -> None:
        self._rate_hz = rate_hz
        self._names = tuple(channels)
        self._limits = limits
        self._n_checked = max(2, round(_POLL_S * rate_hz))
        self._n_spectrum = round(_SPECTRUM_S * rate_hz)
        self._past = np.empty((0, len(self._names)))
        self._new: list[NDArray[np.float64]] = []
        self._n_new = 0
        self._next_index: int | None = None
        self._gaps: list[int] = []
        self._checks: Counter[str] = Counter()
        self.now: tuple[str, ...] = ()

    def take(self, chunk: EmgChunk) -> None:
        """Look at the next samples."""
        if self._next_index is not None and chunk.first_index > self._next_index:
            self._gaps.append(chunk.first_index - self._next_index)
        self._next_index = chunk.first_index + len(chunk.samples)
        left = chunk.samples
        while len(left):
            room = self._n_checked - self._n_new
            part, left = left[:room], left[room:]
            self._new.append(part)
            self._n_new += len(part)
            if self._n_new == self._n_checked:
                self._past = np.concatenate([self._past, *self._new])[-self._n_spectrum :]
                self._new, self._n_new = [], 0
                self.now = tuple(self._check())
                self._checks.update(self.now)

    def words(self) -> tuple[str, ...]:
        """Return every finding so far, one sentence each, with how long it lasted."""
        # A copy, since another thread may ask while samples arrive.
        looks = list(self._checks.items())
        found = [f"{words} (for {n * _POLL_S:g} s)" for words, n in looks]
        if self._gaps:
            longest_ms = 1000 * max(self._gaps) / self._rate_hz
            n, lost = len(self._gaps), sum(self._gaps)
            found.insert(0, f"{lost} samples were lost in {n} gaps, the longest {longest_ms:.0f} ms")
        return tuple(found)

    @np.errstate(over="ignore", invalid="ignore")  # a sender may send anything
    def _check(self) -> list[str]:
        recent = self._past[-self._n_checked :]
        words: list[str] = []
        sound: list[int] = []
        for k, name in enumerate(self._names):
            fault = self._fault_of(recent[:, k], self._past[:, k])
            words += [f"{name}: {fault}"] if fault else []
            sound += [] if fault else [k]
        moving = bool((np.ptp(recent, axis=0) > 0).any())
        if moving and (share := float((recent[1:] == recent[:-1]).all(axis=1).mean())) > REPEATED_SHARE:
            words.append(
                f"rows repeat: only about {(1 - share) * self._rate_hz:.0f} of {self._rate_hz:g} samples/s are new"
            )
        words += self._bridges(sound)
        return words

    def _fault_of(self, recent: NDArray[np.float64], past: NDArray[np.float64]) -> str:
        if not np.isfinite(recent).all():
            return "delivers values that are no numbers"
        low, high = self._limits or (-np.inf, np.inf)
        at_limit = float(((recent <= low) | (recent >= high)).mean())
        if at_limit > RAILED_SHARE:
            return "at the converter's limit: electrode off, cable out, or amplifier saturated"
        if np.ptp(recent) == 0:
            return "no signal at all: cable out or channel switched off"
        if at_limit > CLIPPED_SHARE:
            return "clipped: its peaks are cut off, so effort reads too low; lower the gain"
        return _mains(past, self._rate_hz)

    def _bridges(self, sound: Sequence[int]) -> list[str]:
        past = self._past
        if len(past) < self._n_spectrum:
            return []
        centred = past - past.mean(axis=0)
        crossings = (np.signbit(centred[1:]) != np.signbit(centred[:-1])).sum(axis=0) / _SPECTRUM_S
        raw = [k for k in sound if crossings[k] > RAW_CROSSINGS_PER_S]
        words = []
        for a, b in itertools.combinations(raw, 2):
            both = centred[:, a] @ centred[:, b]
            size = float(np.sqrt((centred[:, a] @ centred[:, a]) * (centred[:, b] @ centred[:, b])))
            if size > 0 and abs(both) / size > BRIDGED_CORRELATION:
                words.append(
                    f"{self._names[a]} and {self._names[b]}: the same signal: electrodes bridged by gel or sweat"
                )
        return words


def _mains(signal: NDArray[np.float64], rate_hz: float) -> str:
    """Name the mains in a channel, or return an empty string."""
    share, line_hz = max((_line_share(signal, rate_hz, f), f) for f in (50.0, 60.0))
    if share > LOOSE_SHARE:
        return f"mostly {line_hz:g} Hz mains: electrode or reference loose, or lifted off"
    if share > MAINS_SHARE:
        return f"{line_hz:g} Hz mains: check the reference electrode, unplug the charger"
    return ""


def _line_share(signal: NDArray[np.float64], rate_hz: float, line_hz: float) -> float:
    """Return the line's share of the power above 5 Hz; 0 where it does not stand out of its neighbours."""
    if len(signal) < _SPECTRUM_S * rate_hz or line_hz + 8 >= rate_hz / 2 or not np.isfinite(signal).all():
        return 0.0
    power = np.abs(np.fft.rfft((signal - signal.mean()) * np.hanning(len(signal)))) ** 2
    hz = np.fft.rfftfreq(len(signal), 1 / rate_hz)
    away = np.abs(hz - line_hz)
    line, near, whole = power[away <= 1.0], power[(away >= 3) & (away <= 8)], power[hz >= 5.0].sum()
    if whole <= 0 or line.max() < MAINS_PEAK * near.mean():
        return 0.0
    # What the neighbourhood would have there anyway is muscle.
    return float(max(0.0, line.sum() - near.mean() * len(line)) / whole)


def swapped_channels(drives: ArrayLike, names: Sequence[str]) -> str:
    """Say whether electrodes sit on each other's muscles, from one guided movement per muscle.

    ``drives`` (muscles, channels) is how much each channel rose over rest, as a share of its own maximum, while
    the muscle that belongs to the channel of the same row worked alone. The result is a sentence, ``""`` where
    the channels, ``names`` in that order, fit best as they are.

    Example:
        >>> swapped_channels([[0.1, 0.8, 0.1], [0.9, 0.2, 0.2], [0.1, 0.1, 0.7]], ["ch3", "ch6", "ch8"])
        'ch3 and ch6 look swapped: each rises with the muscle of the other'
    """
    rises = np.maximum(np.asarray(drives, np.float64), 1e-3)
    own = list(range(len(names)))
    if rises.shape != (len(names), len(names)) or len(names) > 7:
        return ""
    best = max(itertools.permutations(own), key=lambda order: np.log(rises[own, list(order)]).sum())
    moved = [k for k in own if best[k] != k]
    # The ratio is per channel that moved, so that a cycle of three is not found more easily than a pair.
    gain = np.log(rises[moved, [best[k] for k in moved]] / rises[moved, moved]) if moved else np.zeros(1)
    if gain.mean() < np.log(SWAPPED_RATIO):
        return ""
    if len(moved) == 2:
        first, second = (names[k] for k in moved)
        return f"{first} and {second} look swapped: each rises with the muscle of the other"
    where = ", ".join(f"{names[best[k]]} belongs where {names[k]} is" for k in moved)
    return f"electrodes look mixed up: {where}"
