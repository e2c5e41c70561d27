"""Adapt gain and offset of EMG channels online, within limits, while rest or a known target is sure.

Skin dries, sweats and moves under an electrode, so the same effort gives other numbers after ten minutes. The
decoder's input is corrected slowly, one channel at a time: amplitude' = gain x (amplitude - offset). The offset
shrinks raw samples towards their mean (none changes its sign) and is subtracted from rectified samples and envelopes.

==================  ==================================================================================================
offset              brings the amplitude at rest back to that of the run's first sure rest
gain                brings the amplitude at a target back to that at the target's first time in the run
rest is sure        for 3 s the hand is asked to be open, no channel is above 15 % of its maximum, all are believed
target is sure      somebody said 1.5 s ago which closure is meant, and for 3 s the decoder is within 0.35 of it
never               while a finger touches, in any state but armed or active, or where a sample is missing
within any minute   gain x 1.1 or / 1.1, offset 2 % of the maximum; the settings say how much
in all              gain x 1.5 or / 1.5, offset 0 to 10 % of the maximum
undone              by one key, at once and exactly; pressed again, the key starts adaptation over
==================  ==================================================================================================

The result depends only on the samples, however they are cut into chunks, and on the switches as read at the end of
each block. The switches are recorded, so a replay gives the same changes, bit for bit.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.config.calibration import EmgMaxima
from tega.config.stage_sections import AdaptationSection
from tega.records import Adaptation, AdaptationSwitch, Intent

MOST_GAIN: Final = 1.5
MOST_OFFSET: Final = 0.1
"""Largest offset, as a share of the calibrated maximum."""
EVIDENCE_S: Final = 3.0
REACTION_S: Final = 1.5
MINUTE_S: Final = 60.0
_REST_BELOW = 0.15
_REST_CLOSURE = 0.05
_TARGET_WITHIN = 0.35
# Smaller errors are noise, and would be reported for nothing.
_REST_ERROR = 0.005
_TARGET_ERROR = 0.05
# A step goes half of the way.
_STEP = 0.5
# A muscle takes part in a target if it gives this many times what it gives at rest.
_TAKES_PART = 3.0
_TIME_S = 3.0
_SPREADS = 1.5
_MEAN_S = 1.0
# Beyond it no number comes from an amplifier, and sums could overflow.
_LARGEST = 1e100


class Switches(NamedTuple):
    """Switches of the adaptation, as they are at the end of a block.

    ``target`` is the closure that the participant is asked to hold, 0 to 1; ``None`` if no target was announced.
    """

    allowed: bool = False
    target: float | None = None
    n_undone: int = 0


class _Amplitude:
    """Robust recursive mean of every channel: a block counts with at most 1.5 mean deviations."""

    def __init__(self, block_s: float) -> None:
        self._gain = -math.expm1(-block_s / _TIME_S)
        self._n_enough = math.ceil(EVIDENCE_S / block_s)
        self.forget()

    def forget(self) -> None:
        self.n, self.mean, self._spread = 0, np.empty(0), np.empty(0)

    @property
    def sure(self) -> bool:
        return self.n >= self._n_enough

    def take(self, amplitude: NDArray[np.float64]) -> None:
        if self.n == 0:
            self.mean, self._spread = amplitude.copy(), 0.5 * amplitude
        else:
            away = amplitude - self.mean
            most = _SPREADS * self._spread
            gain = max(self._gain, 1.0 / (self.n + 1))
            self.mean = self.mean + gain * np.clip(away, -most, most)
            self._spread = self._spread + gain * (np.minimum(np.abs(away), 2 * most) - self._spread)
        self.n += 1


class ChannelAdaptation:
    """Adapts the channels of one source as their samples come.

    ``switches`` is called at the end of every block with the number of samples so far, ``notify`` with every
    change. ``gains`` and ``offsets`` are float64 (channels,), offsets in the unit of the samples.
    """

    def __init__(
        self,
        maxima: EmgMaxima,
        settings: AdaptationSection,
        *,
        switches: Callable[[int], Switches],
        notify: Callable[[Adaptation | AdaptationSwitch], None] = lambda _reported: None,
    ) -> None:
        n = len(maxima.channels)
        self._full, self._raw = np.array(maxima.maxima), maxima.kind == "raw"
        self._block, self._rate_hz = maxima.tau, maxima.rate_hz
        block_s = maxima.tau / maxima.rate_hz
        self._most_gain = math.log1p(settings.gain_percent_per_min / 100)
        self._most_offset = settings.offset_percent_per_min / 100
        self._switches, self._notify = switches, notify
        self._seen = Switches()
        self._given: list[NDArray[np.float64]] = []
        self._made: list[NDArray[np.float64]] = []
        self._n_block = self._n_samples = 0
        self._mean: NDArray[np.float64] | None = None
        self._mean_gain = -math.expm1(-block_s / _MEAN_S)
        self._amplitude = _Amplitude(block_s)
        self._n_reaction, self._n_since_target = math.ceil(REACTION_S / block_s), 0
        self._text: Intent | None = None
        self._kind: tuple[str, float] = ("", 0.0)
        self._rest: NDArray[np.float64] | None = None
        self._at_target: dict[float, NDArray[np.float64]] = {}
        self._changes: deque[tuple[int, NDArray[np.float64], NDArray[np.float64]]] = deque()
        self.gains, self.offsets = np.ones(n), np.zeros(n)

    @property
    def adapted(self) -> bool:
        """Whether any channel is not as it came."""
        return bool((self.gains != 1).any() or (self.offsets != 0).any())

    def take(self, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        """Adapt the next samples, none beyond the end of a block: its end is the end of a hop of the votes.

        They are float64 (n, channels), NaN where missing, infinite where a channel has no vote; these values
        are unchanged. If nothing is adapted, the same object is returned.
        """
        made = samples
        if self.adapted:
            with np.errstate(invalid="ignore"):
                if self._raw:
                    mean = self._mean
                    assert mean is not None  # nothing is adapted before the first block
                    away = samples - mean
                    shrunk = np.sign(away) * np.maximum(np.abs(away) - self.offsets, 0.0)
                    made = mean + self.gains * shrunk
                else:
                    made = self.gains * np.maximum(samples - self.offsets, 0.0)
            made = np.where(np.isfinite(samples), made, samples)
        self._given.append(samples)
        self._made.append(made)
        self._n_block += len(samples)
        self._n_samples += len(samples)
        return made

    def decoded(self, blocks: Sequence[Intent], t_ns: int) -> None:
        """Take the intents of the samples just adapted; at a block's end, update gains and offsets."""
        if blocks:
            self._text = blocks[-1]
        if self._n_block < self._block:
            return
        given, made = np.concatenate(self._given), np.concatenate(self._made)
        self._given, self._made, self._n_block = [], [], 0
        if not (np.abs(given) < _LARGEST).all():  # not so for NaN
            self._amplitude.forget()
            self._read(t_ns)
            return
        mean = np.add.reduce(given) / len(given)
        self._mean = mean if self._mean is None else self._mean + self._mean_gain * (mean - self._mean)
        away = np.abs(made - self._mean) if self._raw else made
        self._read(t_ns)
        self._check(np.add.reduce(away) / len(away), t_ns)

    def _read(self, t_ns: int) -> None:
        """Read the switches, and undo the adaptation if requested."""
        seen = self._switches(self._n_samples)
        if seen == self._seen:
            return
        before, self._seen = self._seen, seen
        self._notify(AdaptationSwitch(t_ns=t_ns, n_samples=self._n_samples, **seen._asdict()))
        self._amplitude.forget()
        if seen.target != before.target:
            self._n_since_target = 0
        if seen.n_undone != before.n_undone:
            self.gains, self.offsets = np.ones_like(self.gains), np.zeros_like(self.offsets)
            self._reported("undone" if seen.n_undone % 2 else "again", t_ns)

    def _check(self, amplitude: NDArray[np.float64], t_ns: int) -> None:
        """Take a block's amplitudes as evidence, and change gains or offsets once there is enough of it."""
        self._n_since_target += 1
        kind = self._sure_of(amplitude)
        if kind != self._kind:
            self._kind = kind
            self._amplitude.forget()
        if not kind[0]:
            return
        self._amplitude.take(amplitude)
        if not self._amplitude.sure:
            return
        found = self._amplitude.mean
        changed = self._change_offsets(found) if kind[0] == "rest" else self._change_gains(found, kind[1])
        if changed:
            # What was measured was with the old numbers.
            self._amplitude.forget()
            self._reported(kind[0], t_ns)

    def _sure_of(self, amplitude: NDArray[np.float64]) -> tuple[str, float]:
        """Return the detected activity: ``rest``, or ``target`` with its closure; empty if neither is certain."""
        nothing, text, seen = ("", 0.0), self._text, self._seen
        if not seen.allowed or seen.n_undone % 2 or text is None or not all(text.channels):
            return nothing
        closure = (text.level - 1) / 4 if text.closure is None else text.closure
        if seen.target is None or seen.target < _REST_CLOSURE:
            is_rest = closure < _REST_CLOSURE and bool((amplitude < _REST_BELOW * self._full).all())
            return ("rest", 0.0) if is_rest else nothing
        if self._n_since_target < self._n_reaction or abs(closure - seen.target) > _TARGET_WITHIN:
            return nothing
        return "target", round(seen.target, 1)

    def _change_offsets(self, found: NDArray[np.float64]) -> bool:
        if self._rest is None:
            self._rest = found.copy()
            return False
        error = (found - self._rest) / self._full
        steps = np.where(np.abs(error) > _REST_ERROR, _STEP * error / self.gains, 0.0)
        offsets = np.clip(self.offsets / self._full + steps, 0.0, MOST_OFFSET)
        return self._change(np.zeros_like(steps), offsets - self.offsets / self._full)

    def _change_gains(self, found: NDArray[np.float64], target: float) -> bool:
        first = self._at_target.setdefault(target, found.copy())
        least = _REST_BELOW * self._full if self._rest is None else _TAKES_PART * self._rest
        works = (first > least) & (found > 0)
        error = np.log(np.where(works, first, 1.0) / np.where(works, found, 1.0))
        steps = np.where(np.abs(error) > _TARGET_ERROR, _STEP * error, 0.0)
        logs = np.log(self.gains)
        return self._change(
            np.clip(logs + steps, -math.log(MOST_GAIN), math.log(MOST_GAIN)) - logs, np.zeros_like(steps)
        )

    def _change(self, gain_steps: NDArray[np.float64], offset_steps: NDArray[np.float64]) -> bool:
        """Change logarithms of gains, and offsets as shares, as far as the last minute leaves room."""
        oldest = self._n_samples - MINUTE_S * self._rate_hz
        while self._changes and self._changes[0][0] <= oldest:
            self._changes.popleft()
        gone_gain = sum((np.abs(g) for _, g, _ in self._changes), np.zeros_like(gain_steps))
        gone_offset = sum((np.abs(o) for _, _, o in self._changes), np.zeros_like(offset_steps))
        gain_room = np.maximum(self._most_gain - gone_gain, 0.0)
        offset_room = np.maximum(self._most_offset - gone_offset, 0.0)
        gain_steps = np.clip(gain_steps, -gain_room, gain_room)
        offset_steps = np.clip(offset_steps, -offset_room, offset_room)
        if not (gain_steps.any() or offset_steps.any()):
            return False
        self._changes.append((self._n_samples, gain_steps, offset_steps))
        self.gains = self.gains * np.exp(gain_steps)
        self.offsets = np.maximum(self.offsets + offset_steps * self._full, 0.0)
        return True

    def _reported(self, why: str, t_ns: int) -> None:
        gains, offsets = tuple(self.gains.tolist()), tuple(self.offsets.tolist())
        self._notify(Adaptation(t_ns=t_ns, n_samples=self._n_samples, why=why, gains=gains, offsets=offsets))


def read_switches(recorded: Sequence[AdaptationSwitch]) -> Callable[[int], Switches]:
    """Return the switches that a run read, by the number of samples at which it read them."""
    waiting, now = deque(recorded), Switches()

    def at(n_samples: int) -> Switches:
        nonlocal now
        while waiting and waiting[0].n_samples <= n_samples:
            one = waiting.popleft()
            now = Switches(one.allowed, one.target, one.n_undone)
        return now

    return at
