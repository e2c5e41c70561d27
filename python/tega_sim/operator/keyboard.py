"""Steer a simulated lift from the keyboard, in place of a simulated person: keys set level and forearm."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

from tega_sim.operator.motor import level_effort
from tega_sim.operator.person import typical_person
from tega_sim.seams import Act, Percept

KEYS_HELP = (
    "1 to 5: close to that level · space: let go · up, down: lift, lower · right, left: nearer, away · q: end"
)
"""The keys, in one line."""

_STEP_M = 0.02
_SPEED_M_S = 0.15
_HIGHEST_M = 0.30
_FARTHEST_M = 0.10


class KeyboardOperator:
    """Turns keys into acts; the excitation rises and falls as a typical person's does, without error or noise.

    Args:
        keys: Returns the keys pressed since it was last called, such as :meth:`tega.runtime.keys.Keys.read`.
        full_effort: Excitation at which a channel's mean is Emax.

    Example:
        >>> from tega_sim.operator import KeyboardOperator
        >>> KeyboardOperator(lambda: ["3"]).level
        1
    """

    def __init__(self, keys: Callable[[], Sequence[str]], *, full_effort: float = 0.7) -> None:
        self._keys, self._full, self._p = keys, full_effort, typical_person().motor
        self.begin()

    def begin(self, name: str = "", *, width_m: float = 0.0, trial: int = 0, rest_s: float = 0.0) -> None:
        """Start over; the arguments are those of :meth:`tega_sim.operator.Operator.begin` and change nothing."""
        del name, width_m, trial, rest_s
        self.level = 1
        self._ended = self._held = False
        self._wanted_m = self._at_m = (0.0, _FARTHEST_M)
        self._first = self._shaped = self._full * level_effort(self._p, 1)
        self._last_s = 0.0

    def act(self, percept: Percept) -> Act:
        """Return the act that the keys ask for now."""
        for key in self._keys():
            self._press(key)
        dt_s = max(percept.t_s - self._last_s, 0.0)
        self._last_s = percept.t_s
        target = self._full * level_effort(self._p, self.level)
        keep = math.exp(-dt_s * 1e3 / self._p.lag_ms)
        self._first = target + (self._first - target) * keep
        self._shaped = self._first + (self._shaped - self._first) * keep
        most_m = _SPEED_M_S * dt_s
        height, back = (
            at + min(max(wanted - at, -most_m), most_m)
            for wanted, at in zip(self._wanted_m, self._at_m, strict=True)
        )
        self._at_m = (height, back)
        return Act(min(self._shaped, 1.15), self._at_m, self._phase())

    def _press(self, key: str) -> None:
        height, back = self._wanted_m
        if key in {"1", "2", "3", "4", "5"}:
            self.level = int(key)
        elif key == " ":
            self.level = 1
        elif key in {"up", "down"}:
            height += _STEP_M if key == "up" else -_STEP_M
        elif key in {"right", "left"}:
            back += _STEP_M if key == "left" else -_STEP_M
        elif key in {"q", "Q"}:
            self._ended = True
        self._held = self._held or self.level > 1
        self._wanted_m = (min(max(height, 0.0), _HIGHEST_M), min(max(back, 0.0), _FARTHEST_M))

    def _phase(self) -> str:
        (height, back), (wanted, _) = self._at_m, self._wanted_m
        if self._ended:
            return "done"
        if self.level == 1:
            return "release" if self._held else "reach"
        if wanted > height:
            return "lift"
        if wanted < height:
            return "place"
        if height > 0:
            return "hold"
        return "reach" if back > 0 else "grasp"
