"""The arm's chain from the equations alone: One-Euro in plain numbers, and what a row of targets must obey."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from tega.arm import ArmCommand, LimitSettings, Pose

GIVE_M = 1e-8
GIVE_RAD = 1e-7


def one_euro(
    samples: Iterable[tuple[float, float]], min_cutoff: float, beta: float, d_cutoff: float
) -> list[float]:
    """Return the published filter's output for (seconds, value), one axis.

    Casiez, Roussel, Vogel 2012, algorithm 1: low-pass the derivative, which is taken against the last filtered
    value, and low-pass the value with a cutoff that rises with it.
    """
    out: list[float] = []
    before_s, hat, dhat = 0.0, 0.0, 0.0
    for t_s, x in samples:
        if not out:
            hat = x
        else:
            period = t_s - before_s

            def alpha(cutoff: float, period: float = period) -> float:
                tau = 1.0 / (2.0 * math.pi * cutoff)
                return 1.0 / (1.0 + tau / period)

            dx = (x - hat) / period
            dhat = alpha(d_cutoff) * dx + (1 - alpha(d_cutoff)) * dhat
            a = alpha(min_cutoff + beta * abs(dhat))
            hat = a * x + (1 - a) * hat
        before_s = t_s
        out.append(hat)
    return out


class Obedience:
    """Sees commands one after the other, and raises where the targets break a limit.

    It knows times and targets only. If the target's velocity v(t) never changes faster than A, the mean velocities of
    two ticks that follow one another differ by at most A (dt1 + dt2) / 2; if |v| <= V, a tick's way is at most V dt.
    """

    def __init__(self, limits: LimitSettings) -> None:
        self.limits = limits
        self.last: tuple[int, Pose] | None = None
        self.tick: tuple[float, np.ndarray, np.ndarray] | None = None
        self.moved_m = 0.0

    def observe(self, command: ArmCommand) -> None:
        target, limits = command.target, self.limits
        if target is None:
            self.last = self.tick = None
            return
        place, q = target
        assert np.isfinite(place).all()
        assert np.isfinite(q).all()
        assert abs(np.linalg.norm(q) - 1) < 1e-12
        assert (place >= np.array(limits.low_m) - GIVE_M).all(), place
        assert (place <= np.array(limits.high_m) + GIVE_M).all(), place
        tool = Rotation.from_quat(q).apply(np.array(limits.tool_axis) / np.linalg.norm(limits.tool_axis))
        upright = np.array(limits.upright) / np.linalg.norm(limits.upright)
        tilt = math.atan2(float(np.linalg.norm(np.cross(tool, upright))), float(tool @ upright))
        assert tilt <= limits.tilt_rad + GIVE_RAD, tilt
        if self.last is not None:
            dt_s = (command.t_ns - self.last[0]) / 1e9
            route = place - self.last[1].position_m
            turn = (
                Rotation.from_quat(q) * Rotation.from_quat(self.last[1].quaternion_xyzw).inv()
            ).as_rotvec()
            if dt_s <= 0:
                assert not route.any(), "moved in no time"
                assert not (q - self.last[1].quaternion_xyzw).any(), "turned in no time"
            else:
                self._moved(dt_s, route / dt_s, turn / dt_s)
            self.moved_m += float(np.linalg.norm(route))
        self.last = command.t_ns, target

    def _moved(self, dt_s: float, v: np.ndarray, w: np.ndarray) -> None:
        limits = self.limits
        assert np.linalg.norm(v) <= limits.speed_m_s + GIVE_M / dt_s, np.linalg.norm(v)
        assert np.linalg.norm(w) <= limits.turn_rad_s + GIVE_RAD / dt_s, np.linalg.norm(w)
        if self.tick is not None:
            before_s, before_v, before_w = self.tick
            most_s, rounding = (dt_s + before_s) / 2, 1 / dt_s + 1 / before_s
            change, turning = np.linalg.norm(v - before_v), np.linalg.norm(w - before_w)
            assert change <= limits.acceleration_m_s2 * most_s + GIVE_M * rounding, change
            assert turning <= limits.turn_acceleration_rad_s2 * most_s + GIVE_RAD * rounding, turning
        self.tick = dt_s, v, w


numbers = st.floats(-1, 1)
vectors = st.tuples(numbers, numbers, numbers).map(np.array)
quaternions = (
    st.tuples(numbers, numbers, numbers, numbers)
    .map(np.array)
    .filter(lambda q: np.linalg.norm(q) > 0.1)
    .map(lambda q: q / np.linalg.norm(q))
)


def turn_between(a: np.ndarray, b: np.ndarray) -> float:
    return float((Rotation.from_quat(a) * Rotation.from_quat(b).inv()).magnitude())
