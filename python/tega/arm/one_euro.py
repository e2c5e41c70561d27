"""Filter places in metres and rotations by the One-Euro filter (Casiez, Roussel, Vogel: CHI 2012).

For a sample x after dt seconds::

    alpha(f)  = 1 / (1 + 1 / (2 π f dt))
    speed    += alpha(speed_cutoff) · ((x - filtered) / dt - speed)
    cutoff    = min_cutoff + beta · |speed|
    filtered += alpha(cutoff) · (x - filtered)

``speed`` is a vector and its length sets one cutoff for all axes, so that the path does not bend. For rotations
the difference x - filtered is the rotation vector log(x filtered⁻¹), and adding is turning on by exp: slerp.
"""

from __future__ import annotations

import math

import numpy as np

from tega.arm.pose import Pose
from tega.arm.rotation import Floats, between, exp, multiply, same_side, unit
from tega.arm.settings import FilterSettings


def _share(cutoff_hz: float, dt_s: float) -> float:
    around = 2 * math.pi * cutoff_hz * dt_s
    return around / (1 + around)


class OneEuro:
    """Filters places or rotations.

    Args:
        beta: Rise of the cutoff, Hz per m/s; of rotations Hz per rad/s.
        turns: Whether the samples are unit quaternions; each filtered one is on the side of the last.

    Example:
        >>> OneEuro(1.5, 10, 1).step(np.ones(3), 0.01).tolist()
        [1.0, 1.0, 1.0]
    """

    def __init__(self, cutoff_hz: float, beta: float, speed_cutoff_hz: float, *, turns: bool = False) -> None:
        self._cutoff_hz, self._beta, self._speed_cutoff_hz = cutoff_hz, beta, speed_cutoff_hz
        self._turns = turns
        self._speed: Floats = np.zeros(3)
        self._filtered: Floats | None = None

    def step(self, x: Floats, dt_s: float) -> Floats:
        """Return the filtered sample; ``dt_s`` is the time since the last one, more than 0."""
        last = self._filtered
        if last is None:
            self._filtered = x.copy()
            return self._filtered
        difference = between(last, x) if self._turns else x - last
        self._speed += _share(self._speed_cutoff_hz, dt_s) * (difference / dt_s - self._speed)
        step = _share(self._cutoff_hz + self._beta * math.hypot(*self._speed.tolist()), dt_s) * difference
        self._filtered = same_side(unit(multiply(exp(step), last)), last) if self._turns else last + step
        return self._filtered


class PoseFilter:
    """Filters poses by their own stamps."""

    def __init__(self, settings: FilterSettings) -> None:
        self._s = settings
        self.forget()

    def forget(self) -> None:
        """Reset: the next pose is passed on unfiltered."""
        s = self._s
        self._place = OneEuro(s.cutoff_hz, s.beta_per_m, s.speed_cutoff_hz)
        self._turn = OneEuro(s.turn_cutoff_hz, s.turn_beta_per_rad, s.speed_cutoff_hz, turns=True)
        self._last_ns = 0

    def step(self, t_ns: int, pose: Pose) -> Pose:
        """Return the filtered pose; stamps have to rise."""
        if not self._s.on:
            return pose
        dt_s, self._last_ns = (t_ns - self._last_ns) / 1e9, t_ns
        return Pose(self._place.step(pose.position_m, dt_s), self._turn.step(pose.quaternion_xyzw, dt_s))
