"""Refuse tracker poses that jump: a jump that is filtered or slowed down still leads to a wrong place."""

from __future__ import annotations

import math
from typing import Final

import numpy as np

from tega.arm.pose import StampedPose
from tega.arm.rotation import Floats, between, unit
from tega.arm.settings import GateSettings

JUMPED: Final = "it jumped by"
"""How the reason begins for which a pose that is whole and in time is not believed."""


def malformed(pose: StampedPose, settings: GateSettings) -> str:
    """Return why a pose cannot be one, whatever came before it; ``""`` if it can."""
    if not pose.valid:
        return "the tracker calls it lost"
    place, turn = np.asarray(pose.position_m, np.float64), np.asarray(pose.quaternion_xyzw, np.float64)
    if place.shape != (3,) or turn.shape != (4,):
        return f"it is not one place and one turn: shapes {place.shape} and {turn.shape}"
    xyz, xyzw = place.tolist(), turn.tolist()
    if not all(map(math.isfinite, (*xyz, *xyzw))):
        return "a number in it is not finite"
    if abs(math.hypot(*xyzw) - 1) > settings.unit_error:
        return f"its quaternion has length {math.hypot(*xyzw):.4g}, not 1"
    if max(map(abs, xyz)) > settings.room_m:
        return f"it lies {max(map(abs, xyz)):.3g} m away"
    return ""


class PoseGate:
    """Judges poses one after the other; ``last_ns``: stamp of the last believed one, ``None`` before it."""

    def __init__(self, settings: GateSettings) -> None:
        self._s = settings
        self.last_ns: int | None = None
        self._place: list[float] = []
        self._turn: Floats = np.zeros(4)

    def forget(self) -> None:
        """Reset: the next pose may be anywhere, but not older than the last accepted one."""
        self._place = []

    def refusal(self, pose: StampedPose, now_ns: int) -> str:
        """Return why a pose is not believed, ``""`` if it is; then the next one is compared with it."""
        text = malformed(pose, self._s) or self._untimely(pose, now_ns) or self._jump(pose)
        if not text:
            self.last_ns = pose.t_ns
            self._place = np.asarray(pose.position_m, np.float64).tolist()
            self._turn = unit(np.asarray(pose.quaternion_xyzw, np.float64))
        return text

    def _untimely(self, pose: StampedPose, now_ns: int) -> str:
        if self.last_ns is not None and pose.t_ns <= self.last_ns:
            return "it is not newer than the last"
        age_ms = (now_ns - pose.t_ns) / 1e6
        if age_ms > self._s.age_ms:
            return f"it is {age_ms:.0f} ms old"
        if age_ms < -self._s.ahead_ms:
            return f"it lies {-age_ms:.0f} ms in the future"
        return ""

    def _jump(self, pose: StampedPose) -> str:
        if not self._place or self.last_ns is None:
            return ""
        s, dt_s = self._s, (pose.t_ns - self.last_ns) / 1e9
        step_m = math.dist(np.asarray(pose.position_m, np.float64).tolist(), self._place)
        turn = unit(np.asarray(pose.quaternion_xyzw, np.float64))
        step_rad = math.hypot(*between(self._turn, turn).tolist())
        if step_m > min(s.step_m, s.speed_m_s * dt_s):
            return f"{JUMPED} {1e3 * step_m:.0f} mm"
        if step_rad > min(s.step_rad, s.turn_rad_s * dt_s):
            return f"{JUMPED} {step_rad:.2f} rad"
        return ""
