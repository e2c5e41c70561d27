"""Simulate how the person feels the vest: link, motors, skin, noise, and the percepts made of them.

Places are the four finger columns of the front and of the back. A look sums a panel up by its strongest place, as one
who attends to how strong it is and not to where: which finger a column stands for changes nothing here.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega.haptics import MotorLevels
from tega_sim.operator.sections import VestSection, Vision
from tega_sim.operator.vision import Kind, SeenEvent, normal_cdf, reaction_s

# The score of the 75 % point in a comparison of two looks: sqrt(2) * 0.6745.
_TWO_GLANCES = 0.954
# Time between two looks, which is that between two decisions, seconds.
POLL_S = 0.05


class Glance(NamedTuple):
    """One look at the vest: log intensity of front and back as felt, ``None`` where nothing was."""

    t_s: float
    front: float | None
    back: float | None


class Skin:
    """One person's sense of the vest; adaptation outlasts a trial."""

    def __init__(self, vest: VestSection, vision: Vision) -> None:
        self._p, self._choice_s = vest, vision.choice_ms / 1e3
        self._floor_ms = vision.rt_floor_ms
        self.look_sd = math.log1p(vest.weber) / _TWO_GLANCES
        self._adapted = np.ones((2, 4))

    def begin(self, rest_s: float, process: Callable[[str], np.random.Generator]) -> None:
        """Start a trial after a rest, motors still; ``process`` returns the random stream of a name."""
        self._noise, self._link = process("vest"), process("link")
        self._reaction = process("tactile reaction")
        self._adapted = 1 + (self._adapted - 1) * math.exp(-rest_s / self._p.adapt_s)
        self._moving, self._target = np.zeros((2, 4)), np.zeros((2, 4))
        self._queue: deque[tuple[float, NDArray[np.float64]]] = deque()
        self._last_frame: MotorLevels | None = None
        self.looks: deque[Glance] = deque(maxlen=round(2 * self._p.compare_s / POLL_S))
        self._next_compare_s = 0.0

    def feel(self, t_s: float, dt_s: float, frame: MotorLevels | None) -> None:
        """Let the motors run on; a new frame reaches them after the link's delay."""
        if frame is not self._last_frame:
            self._last_frame = frame
            delay_ms = self._p.link_ms + self._p.link_sd_ms * float(self._link.standard_normal())
            delay_ms = min(max(delay_ms, 0.0), self._p.link_max_ms) + self._p.dead_ms
            due = t_s + delay_ms / 1e3
            # The radio keeps the order.
            self._queue.append((max(due, self._queue[-1][0]) if self._queue else due, self._drive(frame)))
        while self._queue and self._queue[0][0] <= t_s:
            self._target = self._queue.popleft()[1]
        if self._target.any() or self._moving.any():
            up, down = (math.exp(-dt_s * 1e3 / lag) for lag in (self._p.lag_up_ms, self._p.lag_down_ms))
            gap = self._target - self._moving
            self._moving = self._target - gap * np.where(gap > 0, up, down)
            self._moving[self._moving < 1e-4] = 0.0

    def check(self, t_s: float, dt_s: float) -> Glance:
        """Attend to the vest once; adaptation goes on by ``dt_s``."""
        p = self._p
        self._adapted += (1 + p.adapt_gain * self._moving - self._adapted) * (dt_s / p.adapt_s)
        missed, swapped = self._noise.random((2, 2))
        errors = self._noise.standard_normal(2)
        side = np.zeros((2, 4))
        side[:, 1:] = self._moving[:, :-1]
        side[:, :-1] = np.maximum(side[:, :-1], self._moving[:, 1:])
        felt = np.maximum(self._moving, p.spread * side) / self._adapted
        panels = [self._read(float(felt[n].max()), float(missed[n]), float(errors[n])) for n in range(2)]
        if swapped[0] < p.panel_swap:
            panels.reverse()
        check = Glance(t_s, panels[0], panels[1])
        self.looks.append(check)
        return check

    def onset(self, t_s: float) -> SeenEvent | None:
        """Return the event of feeling something after silence, if that was the last look."""
        *before, last = self._recent()
        silent = before and all(check.front is None and check.back is None for check in before)
        return self._noticed(t_s, "onset") if silent and (last.front, last.back) != (None, None) else None

    def slip_pulse(self, t_s: float) -> SeenEvent | None:
        """Return the event of feeling both faces at once after neither was, if that was the last look.

        A pulse on one face alone, contact or release of a finger, needs no answer while an object is held.
        """
        *before, now = (None not in {check.front, check.back} for check in self._recent())
        return self._noticed(t_s, "slip") if now and before and not any(before) else None

    def _recent(self) -> list[Glance]:
        """Return the last look, and those of half a second before it."""
        return list(self.looks)[-1 - round(self._p.compare_s / POLL_S) :]

    def weaker(self, t_s: float, falls: tuple[bool | None, bool | None]) -> SeenEvent | None:
        """Compare the last half second with the one before, a few times a second.

        ``falls`` is, for front and back, whether weaker means looser; the person may have learned the
        contrary, or may not heed the panel (``None``).
        """
        if t_s < self._next_compare_s or len(self.looks) < (self.looks.maxlen or 0):
            return None
        self._next_compare_s = t_s + self._p.compare_every_s
        half, looks = len(self.looks) // 2, list(self.looks)
        for panel, sign in zip(("front", "back"), falls, strict=True):
            if sign is None:
                continue
            before, after = (
                [y for check in some if (y := getattr(check, panel)) is not None]
                for some in (looks[:half], looks[half:])
            )
            if self._fell(before, after, half) if sign else self._fell(after, before, half):
                return self._noticed(t_s, "weaker")
        return None

    def mean_log(self, panel: str, since_s: float) -> tuple[float, float] | None:
        """Return a panel's mean log intensity over the looks since a time and the variance of that."""
        ys = [y for check in self.looks if check.t_s > since_s and (y := getattr(check, panel)) is not None]
        # Half of a look's noise stays however many are averaged.
        return (sum(ys) / len(ys), self.look_sd**2 * (0.5 + 0.5 / len(ys))) if ys else None

    def _fell(self, before: list[float], after: list[float], n_checks: int) -> bool:
        if len(before) >= n_checks - 1 and len(after) <= 1:
            return True
        if len(before) < 2 or len(after) < 2:
            return False
        noise = self._p.compare_sds * self.look_sd * math.sqrt(1 / len(before) + 1 / len(after))
        fall = sum(before) / len(before) - sum(after) / len(after)
        return fall > max(math.log1p(self._p.weber), noise)

    def _read(self, intensity: float, missed: float, error: float) -> float | None:
        if intensity <= 0:
            return None
        chance = normal_cdf(math.log(intensity / self._p.threshold) / self._p.threshold_log_sd)
        felt = missed < (1 - self._p.lapse) * chance
        return math.log(intensity) + self.look_sd * error if felt else None

    def _drive(self, frame: MotorLevels | None) -> NDArray[np.float64]:
        """Amplitude that each place goes to: the strongest motor of its column, still below the starting level."""
        if frame is None:
            return np.zeros((2, 4))
        levels = frame.levels.reshape(2, -1, 4).max(axis=1)
        amplitude: NDArray[np.float64] = (levels / 15.0) ** self._p.exponent
        return np.where(levels < self._p.start_level, 0.0, amplitude)

    def _noticed(self, t_s: float, kind: Kind) -> SeenEvent:
        p = self._p
        late = reaction_s(self._reaction, p.rt_ms, p.rt_sigma_ms, p.rt_tau_ms, self._floor_ms)
        return SeenEvent(t_s + late + self._choice_s + p.dual_ms / 1e3, kind, t_s)
