"""Simulate what changes EMG after a calibration: electrode shift, sweat, co-contraction, posture. Simulated.

Off unless named; without them the EMG is the same to the bit. Numbers, ranges and sources: ``effects.toml``.

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
from typing import Final

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import InvalidValueError
from tega.runtime.files.foreign_file import parse_toml
from tega.runtime.words import nearest_hint
from tega_sim.operator.person import Parameter, stream

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

        def normals(effect: str) -> NDArray[np.float64]:
            return stream(seed, "emg", label, effect).standard_normal(3)

        self._names = frozenset(names)
        self.muscle_gain: tuple[float, float, float] = _ONES
        self.turned: NDArray[np.float64] | None = None
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

    def step(self) -> tuple[tuple[float, float, float], NDArray[np.float64] | None]:
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
