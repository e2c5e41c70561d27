"""Synthesise surface EMG of three forearm muscles, from excitation to raw microvolts. Simulated.

For each muscle ``m`` with excitation ``U`` (share of the strongest), slow drive noise ``n`` and unit noise ``c``::

    e = clip(gain U + n sqrt(s0² + (k U)²), 0, 1.2),   then rest + (1 - rest) e
    a = A e^p (1 + 0.5 MF)                             amplitude, µV RMS; MF is the fatigued share
    y = Σ X a c,   c: Gaussian with P(f) = f² fh⁴ / ((f² + fl²)(f² + fh²)²), fl and fh lowered by 1 - 0.35 MF
    z = y + white noise + mains + motion artefacts + offset and its drift

Amplitude-modulated Gaussian noise: Shwedyk, Balasubramanian and Scott 1977; spectrum: Farina and Merletti 2000.
Noise is made in bulk, a second at a time; a call costs some microseconds and any division into calls gives the same
samples. Electrode shift, sweat, co-contraction and posture are effects, off unless named
(:mod:`tega_sim.operator.emg_noise`). Not modelled: motor units, the amplifier's own band, quantisation, lost samples.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega import _native
from tega.emg import GraspIntent, Preset, channel_maxima
from tega.errors import InvalidValueError, ShapeError
from tega_sim.operator.emg_noise import TICK_HZ, Disturbance, NoiseMaker, Second
from tega_sim.operator.person import PersonNumbers, stream
from tega_sim.seams import Act

CHANNELS = ("ecr", "fcu", "fds")
"""Wrist extensor, wrist flexor, finger flexor: the order of the columns."""

# The forearm moves fast, so that electrodes and leads shift, m/s.
_FAST_M_S = 0.1
_POSTURE_M = 0.2
_MOST = 1.2
_NOTHING = (0.0, 0.0, 0.0)


class _Artefact(NamedTuple):
    start: int
    channel: int
    height_uv: float
    omega: float


class ForearmEmg:
    """Raw EMG of a person's forearm.

    Args:
        seed: Seed of everything random.
        label: Which stretch of the session: another trial, other noise and electrodes shifted a little.
        rate_hz: Samples per second, 200 to 10,000.
        settled: Electrodes exactly as at calibration, gain 1.
        effects: What has changed since the calibration: names of :data:`tega_sim.operator.emg_noise.EFFECTS`.

    Raises:
        InvalidValueError: The rate is out of range, or there is no such effect.

    Example:
        >>> from tega_sim.operator import ForearmEmg, typical_person
        >>> forearm = ForearmEmg(typical_person(), seed=1)
        >>> forearm.course([0.0, 0.5, 0.5]).shape
        (30, 3)
    """

    def __init__(
        self,
        person: PersonNumbers,
        *,
        seed: int,
        label: str | int = 0,
        rate_hz: float = 1000.0,
        settled: bool = False,
        effects: Collection[str] = (),
    ) -> None:
        if not 200 <= rate_hz <= 10_000:
            raise InvalidValueError(f"rate_hz = {rate_hz} Hz is not within 200 to 10000")
        p = self._p = person.emg
        self.rate_hz = rate_hz
        self._disturbed = (
            Disturbance(effects, seed=seed, label=label, tick_s=1 / TICK_HZ) if effects else None
        )
        turned = None if self._disturbed is None else self._disturbed.turned
        self._noise = NoiseMaker(p, rate_hz=rate_hz, seed=seed, label=label, turned=turned)
        self._jolts = stream(seed, "emg", label, "artefact")
        gain = np.zeros(3) if settled else p.gain_sd * stream(seed, "emg", label, "gain").standard_normal(3)
        self._gain = np.exp(gain).tolist()
        self._posture = (
            p.posture_sd * stream(seed, "emg", "posture").standard_normal(3) / _POSTURE_M
        ).tolist()
        self._peak_uv = (p.ecr_uv, p.fcu_uv, p.fds_uv)
        self._tick = 0
        self._second: Second | None = None
        self._at_m = (0.0, 0.0)
        self._artefacts: list[_Artefact] = []
        self.fatigue = 0.0

    def samples(self, act: Act) -> NDArray[np.float64]:
        """Return the samples of the hundredth of a second during which the person does ``act``.

        Microvolts, float64 (n, 3), columns as :data:`CHANNELS`; n is the rate over 100 (floor of the running
        sum).
        """
        moved = math.dist(act.forearm_m, self._at_m) * TICK_HZ if self._tick else 0.0
        self._at_m = act.forearm_m
        return self._samples([act.excitation], act.forearm_m[0], moving=moved > _FAST_M_S)

    def course(self, excitation: ArrayLike) -> NDArray[np.float64]:
        """Return the samples of a whole course of excitation with the forearm at rest in the grasp pose.

        ``excitation`` has one value per hundredth of a second, (n,); the samples are microvolts, float64
        (samples, 3).
        """
        values = np.asarray(excitation, np.float64)
        if values.ndim != 1:
            raise ShapeError(f"excitation has shape {values.shape}, expected (n,)")
        left: list[float] = values.tolist()
        parts = []
        while left:
            room = TICK_HZ - self._tick % TICK_HZ
            parts.append(self._samples(left[:room], 0.0, moving=False))
            left = left[room:]
        return np.concatenate(parts) if parts else np.empty((0, 3))

    def rest(self, seconds: float) -> None:
        """Let the muscles recover; no samples are made."""
        self.fatigue *= math.exp(-self._p.recovery_per_s * self._p.recovery_at_rest * seconds)

    def _samples(self, excitations: list[float], height_m: float, *, moving: bool) -> NDArray[np.float64]:
        tick, n = self._tick % TICK_HZ, len(excitations)
        if tick == 0 or self._second is None:
            self._second = self._noise.second(self.fatigue)
        second = self._second
        scales, electrodes, jolts = [], [], []
        for k, excitation in enumerate(excitations, tick):
            added, gains = (_NOTHING, None) if self._disturbed is None else self._disturbed.step()
            scales.append(self._scales(excitation, second.drive[k], added, height_m))
            electrodes.append(gains)
            rate = self._p.artefact_hz * (self._p.artefact_moving if moving else 1.0)
            if second.chance[k] < rate / TICK_HZ:
                self._artefacts.append(self._artefact())
            if self._artefacts:
                jolts.append((k, self._tick, self._artefacts))
                oldest = self._tick - round(12 * self._p.artefact_decay_ms / 1e3 * TICK_HZ)
                self._artefacts = [jolt for jolt in self._artefacts if jolt.start > oldest]
            self._tire(excitation)
            self._tick += 1
        bounds = second.bounds[tick : tick + n + 1]
        first, end = bounds[0], bounds[-1]
        if n == 1 and electrodes[0] is None:  # one tick, as a trial asks for it, has one amplitude
            signal = _native.mix_muscles(second.sensor, second.sources, scales[0], first, end)
        else:
            signal = second.sensor[first:end].copy()
            lengths = np.diff(bounds)
            for m, source in enumerate(second.sources):
                seen = source[first:end] * np.repeat([row[m] for row in scales], lengths)[:, None]
                signal += (
                    seen if electrodes[0] is None else seen * np.repeat(np.array(electrodes), lengths, axis=0)
                )
        for k, at, artefacts in jolts:
            self._shake(signal[second.bounds[k] - first : second.bounds[k + 1] - first], at, artefacts)
        return signal

    def _scales(
        self, excitation: float, drive: list[float], added: tuple[float, float, float], height_m: float
    ) -> tuple[float, ...]:
        p = self._p
        slow_sd = math.sqrt(p.drive_floor**2 + (p.drive_share * excitation) ** 2)
        stronger = 1 + p.fatigue_gain * self.fatigue
        scales = []
        for m, slow in enumerate(drive):
            gain = self._gain[m] * math.exp(self._posture[m] * height_m)
            if self._disturbed is not None:
                gain *= self._disturbed.muscle_gain[m]
            e = min(max(gain * excitation + slow * slow_sd + added[m], 0.0), _MOST)
            e = p.rest_share + (1 - p.rest_share) * e
            scales.append(self._peak_uv[m] * e**p.power * stronger)
        return tuple(scales)

    def _tire(self, excitation: float) -> None:
        """Three-compartment model; the active share follows the excitation as far as muscle is left."""
        p, active = self._p, min(max(excitation, 0.0), 1 - self.fatigue)
        faster = p.recovery_at_rest if excitation <= 0.10 else 1.0
        change = p.fatigue_per_s * active - faster * p.recovery_per_s * self.fatigue
        self.fatigue += change / TICK_HZ

    def _artefact(self) -> _Artefact:
        p = self._p
        where, size, speed, sign = self._jolts.random(4)
        height = p.artefact_low_uv + (p.artefact_high_uv - p.artefact_low_uv) * size
        omega = 2 * math.pi * (1 + 7 * speed)
        return _Artefact(self._tick, int(3 * where), float(height if sign < 0.5 else -height), float(omega))

    def _shake(self, signal: NDArray[np.float64], tick: int, artefacts: list[_Artefact]) -> None:
        decay_s = self._p.artefact_decay_ms / 1e3
        inside_s = np.arange(len(signal)) / self.rate_hz
        for jolt in artefacts:
            t_s = (tick - jolt.start) / TICK_HZ + inside_s
            signal[:, jolt.channel] += jolt.height_uv * np.exp(-t_s / decay_s) * np.cos(jolt.omega * t_s)


_SQUEEZE_S = 3.0
_PAUSE_S = 2.0
_SQUEEZES = 3
# The rise of a squeeze, left out where its steady part is looked at.
_RISE_S = 0.5


class Calibrated(NamedTuple):
    """Maxima of a simulated person's muscles, and the effort that these stand for.

    Attributes:
        maxima: For :class:`tega.emg.GraspIntent`, µV, float64 (3,).
        tau: Samples per block that they hold for.
        full_effort: Excitation at which the channels' means are at the maxima in use, for
            :class:`tega_sim.operator.Operator`: what practice with the level on show teaches.
    """

    maxima: NDArray[np.float64]
    tau: int
    full_effort: float


def calibrate(
    person: PersonNumbers, *, seed: int, rate_hz: float = 1000.0, tau_s: float = 0.1, preset: Preset = "live"
) -> Calibrated:
    """Take the maxima of three strong squeezes through the real chain, in blocks of ``tau_s``.

    ``preset`` picks the percentile that is used: the largest block for ``paper``, the 95th for ``live``.
    """
    effort, tau = person.motor.calibration_effort, round(tau_s * rate_hz)
    forearm = ForearmEmg(person, seed=seed, label="calibration", rate_hz=rate_hz, settled=True)
    squeeze = effort * np.minimum(np.arange(round(_SQUEEZE_S * TICK_HZ)) / (_RISE_S * TICK_HZ), 1.0)
    pause = np.zeros(round(_PAUSE_S * TICK_HZ))
    course = np.concatenate([pause, *[np.concatenate([squeeze, pause])] * _SQUEEZES])
    samples = forearm.course(course)
    percentile = 100.0 if preset == "paper" else 95.0
    maxima = channel_maxima(samples, rate_hz, tau=tau, percentile=percentile)
    ticks = (np.arange(len(samples)) * (TICK_HZ / rate_hz)).astype(np.int64)
    steady = samples[course[ticks] >= effort]
    means = channel_maxima(steady, rate_hz, tau=tau, percentile=50.0)
    in_use = GraspIntent(rate_hz, maxima, tau=tau, preset=preset).maxima
    return Calibrated(maxima, tau, effort * float(np.mean(in_use / means)))
