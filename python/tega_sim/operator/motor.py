"""Compute the excitation of the grip muscles from the level that a person has in mind, and move the forearm smoothly.

A command aims at the middle of its level and misses it by an error drawn once; two equal lags shape the rise; held
levels slacken. EMG follows the excitation at once. The person feels the effort later, through activation and
electromechanical delay.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final

import numpy as np

from tega_sim.operator.sections import MotorSection

_MOST = 1.15


def level_effort(motor: MotorSection, level: int) -> float:
    """Return the effort in the middle of a level, as a share of that at Emax."""
    if level <= 1:
        return motor.level_one
    return motor.level_five if level >= 5 else (level - 0.5) / 4


class MuscleMotor:
    """Muscles under a command.

    ``full_effort`` is the excitation that makes a channel's mean Emax, as practised with the calibrated
    system; ``aim`` and ``sense`` are the streams of the aim errors and of the sense of effort.
    """

    def __init__(
        self, motor: MotorSection, *, full_effort: float, aim: np.random.Generator, sense: np.random.Generator
    ) -> None:
        self._p, self._full, self._aim, self._sense = motor, full_effort, aim, sense
        self._target = self._first = self._shaped = self._activation = 0.0
        self._share = 1.0
        self._felt: deque[tuple[float, float]] = deque()
        self._felt_now = self._bias = self.excitation = 0.0

    def command(self, level: int) -> None:
        """Aim at a level; slack restarts."""
        error, floor = self._aim.standard_normal(2)
        self._set_out(level_effort(self._p, level) * (1 + self._p.aim_sd * error) + self._p.aim_floor * floor)

    def shift(self, levels: float) -> None:
        """Change the aim by so many levels from the effort that is made now; the error goes with the change."""
        error, floor = self._aim.standard_normal(2)
        now = self.excitation / self._full
        effort = now + levels / 4
        self._set_out(effort + (effort - now) * self._p.aim_sd * error + self._p.aim_floor * floor)

    def _set_out(self, share: float) -> None:
        self._target = min(max(self._full * float(share), 0.0), _MOST)
        self._share = 1.0
        self._bias = self._p.effort_sd * float(self._sense.standard_normal())

    def step(self, t_s: float, dt_s: float) -> float:
        """Advance to ``t_s`` and return the excitation, 0 to 1.15."""
        keep = math.exp(-dt_s * 1e3 / self._p.lag_ms)
        self._first = self._target + (self._first - self._target) * keep
        self._shaped = self._first + (self._shaped - self._first) * keep
        if self._shaped > self._p.slack_above:
            self._share = max(self._share * math.exp(-self._p.slack_per_s * dt_s), self._p.slack_floor)
        self.excitation = self._shaped * self._share
        speed = 0.5 + 1.5 * self._activation
        rising = self.excitation > self._activation
        tau_ms = self._p.rise_ms * speed if rising else self._p.fall_ms / speed
        self._activation += (self.excitation - self._activation) * (1 - math.exp(-dt_s * 1e3 / tau_ms))
        self._felt.append((t_s + self._p.felt_delay_ms / 1e3, self._activation))
        while self._felt and self._felt[0][0] <= t_s:
            self._felt_now = self._felt.popleft()[1]
        return self.excitation

    def felt_level(self) -> float:
        """Return the own effort as it is felt now, in levels; wrong by one share as long as a command lasts."""
        return 4 * self._felt_now * (1 + self._bias) / self._full + 0.5


AWAY_M: Final = 0.1
"""Distance of the second marked place from the first, back from the palm, metres; a task of one place has none."""

FARTHEST_M: Final = 0.2
"""How far back the hand can be led, metres."""


class SimulatedForearm:
    """Moves the hand as a whole from place to place, with minimum jerk.

    ``start_m`` is height over the grasp pose and distance back from it.
    """

    def __init__(self, start_m: tuple[float, float]) -> None:
        self._from = self._to = self.at_m = start_m
        self._start_s = self._duration_s = 0.0

    def move(self, to_m: tuple[float, float], t_s: float, duration_s: float) -> None:
        """Set out from where the hand is now; it arrives ``duration_s`` later."""
        self._from, self._to = self.at_m, to_m
        self._start_s, self._duration_s = t_s, duration_s

    def step(self, t_s: float) -> tuple[float, float]:
        """Return the place at ``t_s``."""
        share = 1.0 if self._duration_s <= 0 else min(max((t_s - self._start_s) / self._duration_s, 0.0), 1.0)
        eased = share**3 * (10 - 15 * share + 6 * share * share)
        (height, back), (up, away) = self._from, self._to
        self.at_m = (height + (up - height) * eased, back + (away - back) * eased)
        return self.at_m

    def still(self, t_s: float, settle_s: float) -> bool:
        """Whether the last movement ended at least ``settle_s`` ago."""
        return t_s >= self._start_s + self._duration_s + settle_s - 1e-9
