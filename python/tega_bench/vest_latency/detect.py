"""Find when a vest's motor begins to vibrate, in the sound of many bursts.

The rule, for each burst that was commanded at time c and lasted T:

1. The motor's spin frequency f is where the sound of all bursts together stands out most from that before them, 40 to
   400 Hz. The sound is band-passed from 0.35 f to 1.6 f (a motor that spins up passes through lower frequencies; two
   poles, forth and back, so that nothing is shifted), hum taken out first as it was before the burst.
2. Its strength e(t) is the root of the power over a Hann window of 24 ms, less the mean power of the background in
   the 0.3 s before c. Full strength E is the middle e of c + 0.3 s to c + T.
3. Looking back from there, e was last below 60 % of E at t60, and before that last below 25 % at t25. The vibration
   *begins* where the straight line through both meets zero, and is at *half* where e was last below 50 %.
4. A burst is left out, with the reason, if E is not four times the background's loudest moment, the sound clips,
   there is a sound between c and t25, or the vibration is not steady; and if it is further from the middle of the
   others than 3.5 times their scaled median deviation and 15 ms.
5. There is a result only of six bursts and half of all.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.errors import InvalidValueError
from tega.runtime.lifecycle import require

FEWEST: Final = 6
"""Least number of bursts for a result."""
SHORTEST_S: Final = 0.5
"""A burst lasts so long, so that a motor that starts late reaches its full strength."""
MOST_DELAY_S: Final = 0.25
"""Motors that begin later than this are not believed."""

_SPIN_HZ = (40.0, 400.0)
_QUIET_S = (0.32, 0.02)
_SMOOTH_S = 0.024
_SETTLED_S = 0.3
_CLIPPED = 0.985
_TOO_SOFT = "not four times as loud as the background before it"


class BurstOnset(NamedTuple):
    """Onset of one burst.

    Attributes:
        delay_s: From the command to the beginning of the vibration; NaN where ``why`` is not empty.
        half_s: From the command to half of its strength; likewise.
        why: Why it was left out; ``""`` where it counts.
    """

    delay_s: float
    half_s: float
    why: str = ""


class Onsets(NamedTuple):
    """Onsets in a recording, its bursts in order.

    ``spin_hz`` is the motor's frequency; NaN where none stands out. ``problem`` is why there is no result;
    ``""`` where there is one.
    """

    spin_hz: float
    bursts: tuple[BurstOnset, ...]
    problem: str = ""
    hint: str = ""

    @property
    def delays_s(self) -> NDArray[np.float64]:
        """The delays that count, float64 (n,), seconds."""
        return np.array([b.delay_s for b in self.bursts if not b.why])

    @property
    def halves_s(self) -> NDArray[np.float64]:
        """Delays to half of the strength, of the same bursts; float64 (n,), seconds."""
        return np.array([b.half_s for b in self.bursts if not b.why])

    def left_out(self) -> dict[str, int]:
        """Return the number of bursts left out, by reason."""
        return dict(Counter(b.why for b in self.bursts if b.why))


def find_onsets(
    samples: NDArray[np.float64], rate_hz: float, commands_s: Sequence[float], *, on_s: float
) -> Onsets:
    """Find when the motor began to vibrate in each burst.

    ``samples`` is float64 (n,), -1 to 1; ``rate_hz`` must be 2000 or more. ``commands_s`` are from the first
    sample; each burst lasts ``on_s``, 0.5 s or more, with half a second or more of silence between them.
    """
    if rate_hz < 2000:
        raise InvalidValueError(f"sound: {rate_hz:g} samples/s; a motor needs 2000 or more")
    if on_s < SHORTEST_S:
        raise InvalidValueError(f"bursts of {on_s:g} s are too short; {SHORTEST_S:g} s or more are needed")
    signal = load_signal()
    sound = np.asarray(samples, np.float64)
    loudest = float(np.abs(sound).max(initial=0.0))
    received = [c for c in commands_s if c >= _QUIET_S[0] and (c + on_s) * rate_hz < len(sound)]
    if not received:
        return _nothing(commands_s, "no burst lies within the recording", "does it belong to this log?")
    if loudest < 1e-4 or np.ptp(sound) == 0:
        return _nothing(
            commands_s, "the recording is silent: there is no microphone behind it, or it is muted",
            "look whether it is plugged in and its level is up",
        )  # fmt: skip
    spin_hz = _spin(signal, sound, rate_hz, received, on_s)
    if not np.isfinite(spin_hz):
        return _nothing(
            commands_s, "no vibration detected: nothing between 40 and 400 Hz is louder in the bursts",
            "tape the microphone onto this motor; raise --percent or the microphone's level; silence the room",
        )  # fmt: skip
    strength = _Strength(signal, sound, rate_hz, spin_hz)
    bursts = [
        strength.burst(c, on_s) if c in received else _left_out("outside the recording") for c in commands_s
    ]
    return _judged(spin_hz, bursts)


class _Strength:
    """The vibration's strength at any time."""

    def __init__(self, signal: Any, sound: NDArray[np.float64], rate_hz: float, spin_hz: float) -> None:
        self._sound, self._rate_hz = sound, rate_hz
        band = (0.35 * spin_hz, min(1.6 * spin_hz, 0.45 * rate_hz))
        self._sos = signal.butter(2, band, "bandpass", fs=rate_hz, output="sos")
        self._signal = signal
        width = max(3, round(_SMOOTH_S * rate_hz))
        self._window = np.hanning(width + 2)[1:-1]
        self._window /= self._window.sum()

    def burst(self, c: float, on_s: float) -> BurstOnset:
        rate = self._rate_hz
        cut = self._sound[int((c - _QUIET_S[0]) * rate) : int((c + on_s) * rate)]
        if np.count_nonzero(np.abs(cut) > _CLIPPED) > 3:
            return _left_out("the sound clips")
        n_quiet = int((_QUIET_S[0] - _QUIET_S[1]) * rate)
        passed = self._signal.sosfiltfilt(self._sos, _without_hum(cut, rate, n_quiet))
        power = np.convolve(np.abs(self._signal.hilbert(passed)) ** 2, self._window, "same")
        # At either end the window holds too little.
        edge = len(self._window) // 2
        quiet, power = power[edge : n_quiet - edge], power[: len(power) - edge]
        strength = np.sqrt(np.maximum(power - quiet.mean(), 0.0))
        return self._read(strength, loudest=float(np.sqrt(quiet.max())))

    def _read(self, strength: NDArray[np.float64], *, loudest: float) -> BurstOnset:
        """Find where the strength rises, from its course since the quiet part began."""
        rate, edge = self._rate_hz, len(self._window) // 2
        at_c, settled = round(_QUIET_S[0] * rate), round((_QUIET_S[0] + _SETTLED_S) * rate)
        plateau = strength[settled:]
        full = float(np.median(plateau))
        if loudest and full / loudest < 4:
            return _left_out(_TOO_SOFT)
        if plateau.min() < 0.5 * full or plateau.max() > 1.8 * full:
            return _left_out("not steady: another sound, or the motor stutters")
        t60, t50, t25 = (self._last_below(strength, share * full, settled) for share in (0.6, 0.5, 0.25))
        before = strength[at_c - edge : 0 if np.isnan(t25) else max(at_c, int(t25)) - edge]
        if np.isnan(t25) or before.max(initial=0.0) > 0.4 * full:
            return _left_out("another sound before it")
        begin = (t60 * 0.25 - t25 * 0.6) / (0.25 - 0.6)
        delay_s, half_s = (float(begin) - at_c) / rate, (t50 - at_c) / rate
        if not -0.01 <= delay_s <= MOST_DELAY_S:
            return _left_out(f"begins {1e3 * delay_s:.0f} ms after its command, which cannot be")
        return BurstOnset(delay_s, half_s)

    @staticmethod
    def _last_below(strength: NDArray[np.float64], level: float, before: int) -> float:
        """Return where it last rose through a level, between samples; NaN for nowhere."""
        below = np.flatnonzero(strength[:before] < level)
        if not len(below):
            return np.nan
        k = int(below[-1])
        low, high = strength[k], strength[k + 1]
        return k + (float((level - low) / (high - low)) if high > low else 0.0)


def _left_out(why: str) -> BurstOnset:
    return BurstOnset(np.nan, np.nan, why)


def _without_hum(cut: NDArray[np.float64], rate_hz: float, n_quiet: int) -> NDArray[np.float64]:
    """Remove the harmonics of 50 or 60 Hz measured in the quiet part: they continue unchanged in the burst."""
    t = np.arange(len(cut)) / rate_hz
    best, left = cut, np.inf
    for mains_hz in (50.0, 60.0):
        waves = [np.ones_like(t)]
        for harmonic in range(1, 7):
            angle = 2 * np.pi * mains_hz * harmonic * t
            waves += [np.cos(angle), np.sin(angle)]
        basis = np.stack(waves, axis=1)
        fitted, *_ = np.linalg.lstsq(basis[:n_quiet], cut[:n_quiet], rcond=None)
        rest: NDArray[np.float64] = cut - basis @ fitted
        if (power := float(rest[:n_quiet] @ rest[:n_quiet])) < left:
            best, left = rest, power
    return best


def _spin(
    signal: Any, sound: NDArray[np.float64], rate_hz: float, commands_s: Sequence[float], on_s: float
) -> float:
    """Return the frequency at which bursts stand out from the sound before them; NaN for none."""

    def spectrum(from_s: float, to_s: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        found = []
        for c in commands_s:
            cut = sound[int((c + from_s) * rate_hz) : int((c + to_s) * rate_hz)]
            hz, power = signal.periodogram(cut, rate_hz, "hann", nfft=int(rate_hz), detrend="constant")
            found.append(power)
        return hz, np.median(found, axis=0)

    hz, loud = spectrum(_SETTLED_S, on_s)
    _, quiet = spectrum(-_QUIET_S[0], -_QUIET_S[1])
    within = (hz >= _SPIN_HZ[0]) & (hz <= _SPIN_HZ[1])
    # Harmonics of a motor are weaker than its turns.
    more = np.where(within, loud - 10 * quiet, 0.0)
    k = int(more.argmax())
    floor = float(np.median(loud[within]))
    return float(hz[k]) if more[k] > 0 and loud[k] > 8 * floor else float("nan")


def _judged(spin_hz: float, bursts: list[BurstOnset]) -> Onsets:
    """Leave out what is far from all others, and say why there is no result."""
    delays = np.array([b.delay_s for b in bursts if not b.why])
    if len(delays) >= FEWEST - 1:
        middle = float(np.median(delays))
        wide = max(3.5 * 1.4826 * float(np.median(np.abs(delays - middle))), 0.015)
        bursts = [
            b if b.why or abs(b.delay_s - middle) <= wide else b._replace(why="far from all others")
            for b in bursts
        ]
    onsets = Onsets(spin_hz, tuple(bursts))
    n_good = len(onsets.delays_s)
    if n_good >= max(FEWEST, (len(bursts) + 1) // 2):
        return onsets
    why, _ = max(onsets.left_out().items(), key=lambda one: one[1], default=("too few bursts", 0))
    hints = {
        "the sound clips": "lower the microphone's level",
        _TOO_SOFT: "the motor is not louder than the background: is the microphone taped onto this motor? "
        "Silence the room; raise --percent",
        "outside the recording": "does the recording belong to this log, and does it go to the end?",
    }
    return onsets._replace(
        problem=f"only {n_good} of {len(bursts)} bursts can be used; most often: {why}",
        hint=hints.get(why, "do not talk, knock or move meanwhile; try again"),
    )


def _nothing(commands_s: Sequence[float], problem: str, hint: str) -> Onsets:
    return Onsets(float("nan"), (_left_out("no vibration"),) * len(commands_s), problem, hint)


def load_signal() -> Any:
    """Import :mod:`scipy.signal`; ``MissingExtraError`` without SciPy."""
    return require("scipy.signal", driver="vest onset", extra="onset")
