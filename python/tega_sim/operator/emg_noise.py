"""Make what EMG has beside effort: noise in bulk, a second at a time, and changes since the calibration. Simulated.

The changes are off unless named; without them the EMG is the same to the bit. Numbers and sources: ``effects.toml``.

- ``shift``: the electrodes sit turned about the arm. Each sees (1 - w) of its own signal and w of the next one's, w =
  ``neighbour``, with a new random gain.
- ``sweat``: amplitude falls by exp(-loss·depth·(1 - exp(-t / T))), the depth another at each electrode.
- ``cocontraction``: all muscles work ``share`` more than the grip asks for; that comes and goes.
- ``posture``: the arm is held as it was not at the calibration: a static load, and other gains of the muscles.
"""

from __future__ import annotations

import math
from collections.abc import Collection
from functools import cache
from importlib.resources import files
from typing import Final, NamedTuple, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import InvalidValueError
from tega.runtime.files.foreign_file import parse_toml
from tega.runtime.words import nearest_hint
from tega_sim.operator.person import Parameter, stream
from tega_sim.operator.sections import Emg

Floats: TypeAlias = NDArray[np.float64]

TICK_HZ = 100
"""Acts a second."""

# Noise is made at no less than this and every few samples taken, as an amplifier without an anti-alias filter does.
_LEAST_RATE_HZ = 2000.0
# The spectrum's filter has died away after this.
_KERNEL_S = 0.04


class Second(NamedTuple):
    """A second of noise.

    Attributes:
        sources: For each muscle, what full unit activity of it gives at the three electrodes, (n, 3) each.
        sensor: Signal without muscles: white noise, mains, offset and drift, µV, (n, 3).
        drive: Slow drive noise of the three muscles, unit variance, a row a tick.
        chance: A uniform number a tick, for what happens now and then.
        bounds: First sample of each tick, and the end.
    """

    sources: tuple[Floats, Floats, Floats]
    sensor: Floats
    drive: list[list[float]]
    chance: list[float]
    bounds: list[int]


class NoiseMaker:
    """Makes one second after the other; filters run on across them.

    ``label`` is which stretch of the session. ``turned`` are the weights of the former electrode signals in
    each electrode's signal, (3, 3); ``None``: not turned.
    """

    def __init__(
        self, emg: Emg, *, rate_hz: float, seed: int, label: str | int, turned: Floats | None = None
    ) -> None:
        self._p, self._rate_hz = emg, rate_hz
        self._step = math.ceil(_LEAST_RATE_HZ / rate_hz)
        self._taps = round(_KERNEL_S * rate_hz * self._step)
        self._signal = stream(seed, "emg", label, "signal")
        self._slow = stream(seed, "emg", label, "slow drive")
        self._chance = stream(seed, "emg", label, "chance")
        flexors, extensor = emg.crosstalk_flexors, emg.crosstalk_extensor
        self._mix = np.array([[1, extensor, extensor], [extensor, 1, flexors], [extensor, flexors, 1]])
        if turned is not None:
            self._mix = turned @ self._mix
        self._white = self._signal.standard_normal((3, self._taps - 1))
        self._drive: list[float] = self._slow.standard_normal(4).tolist()
        self._wander_uv = np.zeros(3)
        self._mains_phase = 2 * math.pi * float(self._slow.random())
        self._number = 0

    def second(self, fatigue: float) -> Second:
        """Make the next second; a fatigued muscle's spectrum is lower."""
        rate_hz, number = self._rate_hz, self._number
        start, end = math.floor(number * rate_hz), math.floor((number + 1) * rate_hz)
        ticks = range(number * TICK_HZ, (number + 1) * TICK_HZ + 1)
        bounds = [math.floor(tick * rate_hz / TICK_HZ) - start for tick in ticks]
        unit = self._unit(end - start, fatigue)
        sources = [unit[m][:, None] * self._mix[:, m] for m in range(3)]
        sensor = self._sensor(start, end, bounds)
        self._number += 1
        chance: list[float] = self._chance.random(TICK_HZ).tolist()
        return Second((sources[0], sources[1], sources[2]), sensor, self._slow_drive(), chance, bounds)

    def _unit(self, n: int, fatigue: float) -> Floats:
        """Noise of unit variance and the muscles' spectrum, (3, n)."""
        fresh = self._signal.standard_normal((3, n * self._step))
        white = np.concatenate([self._white, fresh], axis=1)
        self._white = white[:, -(self._taps - 1) :]
        slower = 1 - self._p.fatigue_slowing * fatigue
        kernel = _kernel(self._p, self._rate_hz * self._step, self._taps, slower)
        return _filter(white, kernel)[:, :: self._step]

    def _sensor(self, start: int, end: int, bounds: list[int]) -> Floats:
        p = self._p
        angle = 2 * math.pi * p.mains_hz * np.arange(start, end) / self._rate_hz + self._mains_phase
        mains = math.sqrt(2) * p.mains_uv * (np.sin(angle) + 0.3 * np.sin(3 * angle))
        steps_uv = self._slow.standard_normal((TICK_HZ, 3)) * (p.drift_uv / math.sqrt(60 * TICK_HZ))
        wander = self._wander_uv + np.cumsum(steps_uv, axis=0)
        self._wander_uv = wander[-1]
        sensor = self._signal.standard_normal((end - start, 3)) * p.white_uv
        sensor += mains[:, None]
        sensor += np.repeat(wander + p.offset_uv, np.diff(bounds), axis=0)
        return sensor

    def _slow_drive(self) -> list[list[float]]:
        """First-order low-pass noise of unit variance, one common and one for each muscle, mixed."""
        p = self._p
        keep = math.exp(-2 * math.pi * p.drive_corner_hz / TICK_HZ)
        fresh, shared, own = math.sqrt(1 - keep * keep), math.sqrt(p.common), math.sqrt(1 - p.common)
        draws = fresh * self._slow.standard_normal((TICK_HZ, 4))
        draws = np.column_stack([shared * draws[:, 0], own * draws[:, 1:]])
        common, first, second, third = self._drive
        rows = []
        for a, b, c, d in draws.tolist():
            common = keep * common + a
            first, second, third = keep * first + b, keep * second + c, keep * third + d
            rows.append([common + first, common + second, common + third])
        self._drive = [common, first, second, third]
        return rows


def _kernel(p: Emg, rate_hz: float, taps: int, slower: float) -> Floats:
    """Impulse response of the spectrum's filter, unit output variance for unit white input."""
    f = np.fft.rfftfreq(8 * taps, 1 / rate_hz)
    low, high = p.spectrum_low_hz * slower, p.spectrum_high_hz * slower
    response = 1j * f / ((low + 1j * f) * (high + 1j * f) ** 2)
    kernel = np.fft.irfft(response)[:taps]
    shaped: Floats = kernel / np.sqrt(np.sum(kernel * kernel))
    return shaped


def _filter(white: Floats, kernel: Floats) -> Floats:
    """Convolve each row and keep the samples that the kernel covers wholly."""
    size = white.shape[1]
    n_fft = min(k << max(0, math.ceil(math.log2(size / k))) for k in (8, 9, 10, 12, 15))
    spectrum = np.fft.rfft(white, n_fft, axis=1) * np.fft.rfft(kernel, n_fft)
    whole: Floats = np.fft.irfft(spectrum, n_fft, axis=1)[:, len(kernel) - 1 : size]
    return whole


EFFECTS: Final[dict[str, str]] = {
    "shift": "electrodes put on elsewhere",
    "sweat": "amplitude that falls as sweat gathers",
    "cocontraction": "all muscles work more than the grip asks for",
    "posture": "another arm posture than at the calibration",
}
"""Names of the effects, and what each is."""

_ONES: Final = (1.0, 1.0, 1.0)
_NOTHING: Final = (0.0, 0.0, 0.0)


@cache
def effect_parameters() -> dict[str, dict[str, Parameter]]:
    """Return every number of the effects, by effect and name."""
    text = files("tega_sim.operator").joinpath("effects.toml").read_text(encoding="utf-8")
    return msgspec.convert(parse_toml(text), dict[str, dict[str, Parameter]])


class Disturbance:
    """Effects on a stretch of EMG; an unknown name raises :class:`InvalidValueError`.

    Every draw comes from a stream named after the effect, so that no other draw of the session changes.

    Attributes:
        muscle_gain: By which each muscle works more for the same grip.
        turned: Weights of the former electrode signals in each electrode's signal, (3, 3); ``None``: not
            turned.
    """

    def __init__(self, names: Collection[str], *, seed: int, label: str | int, tick_s: float) -> None:
        if unknown := sorted(set(names).difference(EFFECTS)):
            raise InvalidValueError(f"effect {unknown[0]!r} is not known", nearest_hint(unknown[0], EFFECTS))
        p = {
            effect: {name: number.value for name, number in some.items()}
            for effect, some in effect_parameters().items()
        }

        def normals(effect: str) -> Floats:
            return stream(seed, "emg", label, effect).standard_normal(3)

        self._names = frozenset(names)
        self.muscle_gain: tuple[float, float, float] = _ONES
        self.turned: Floats | None = None
        self._load: tuple[float, float, float] = _NOTHING
        self._tick_s, self._n = tick_s, 0
        if "shift" in names:
            w = p["shift"]["neighbour"]
            gain = np.exp(p["shift"]["gain_sd"] * normals("shift"))
            self.turned = gain[:, None] * ((1 - w) * np.eye(3) + w * np.roll(np.eye(3), 1, axis=1))
        if "posture" in names:
            one, two, three = np.exp(p["posture"]["gain_sd"] * normals("posture gain")).tolist()
            self.muscle_gain = (one, two, three)
            self._load = (p["posture"]["extensor"], p["posture"]["flexors"], p["posture"]["flexors"])
        sweat = p["sweat"]
        self._loss = sweat["loss_per_mm"] * sweat["depth_mm"] * np.exp(sweat["uneven_sd"] * normals("sweat"))
        self._sweat_s = sweat["time_s"]
        tension = p["cocontraction"]
        self._share, self._change = tension["share"], tension["change"]
        self._keep = math.exp(-tick_s / tension["time_s"])
        self._tension = stream(seed, "emg", label, "cocontraction")
        self._level = float(self._tension.standard_normal())

    def step(self) -> tuple[tuple[float, float, float], Floats | None]:
        """Go on by a tick.

        Returns what each muscle works more, share of the strongest, and each electrode's gain, (3,), ``None``
        for 1.
        """
        self._n += 1
        added = self._load
        if "cocontraction" in self._names:
            fresh = math.sqrt(1 - self._keep**2) * float(self._tension.standard_normal())
            self._level = self._keep * self._level + fresh
            more = self._share * max(0.0, 1 + self._change * self._level)
            added = (added[0] + more, added[1] + more, added[2] + more)
        if "sweat" not in self._names:
            return added, None
        gathered = -math.expm1(-self._n * self._tick_s / self._sweat_s)
        return added, np.exp(-self._loss * gathered)
