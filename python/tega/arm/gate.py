"""Refuse tracker poses that jump, and watch the time since the last poses and arm reports.

A jump that is filtered or slowed down still leads to a wrong place.
"""

from __future__ import annotations

import math
from collections import deque
from enum import IntEnum
from typing import Final, NamedTuple

import numpy as np

from tega.arm.pose import StampedPose
from tega.arm.rotation import Floats, between, unit
from tega.arm.settings import GateSettings, WatchdogSettings

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


# A tracker that jumps so often within this time has no vote, until so much time has passed without a jump.
_JUMPS = 3
_STEADY_MS = 500.0


class Level(IntEnum):
    """Consequences of trouble, the worse the higher."""

    NONE = 0
    HOLD = 1
    LOSE = 2
    STOP = 3


class Trouble(NamedTuple):
    """Trouble with the poses or the arm, in words for the operator; ``silent``: it is that no poses come."""

    level: Level
    reason: str
    silent: bool = False


class ArmWatch:
    """Keeps the times of the last poses and of the arm's last report."""

    def __init__(self, settings: WatchdogSettings) -> None:
        self._s = settings
        self._believed_ns: int | None = None
        self._refused_ns: int | None = None
        self._refusal = ""
        self._arm_ns: int | None = None
        self._jumps_ns: deque[int] = deque(maxlen=_JUMPS)
        self._untrusted = False

    def forget(self) -> None:
        """Reset: nothing has been received yet."""
        self._believed_ns = self._refused_ns = self._arm_ns = None
        self.forget_jumps()

    def forget_jumps(self) -> None:
        """Forget the forearm's jumps; the operator has to engage again."""
        self._jumps_ns.clear()
        self._untrusted = False

    def believed(self, t_ns: int) -> None:
        """Take note of the stamp of a pose that is believed."""
        self._believed_ns = t_ns

    def refused(self, now_ns: int, why: str) -> None:
        """Take note of a pose that is not."""
        self._refused_ns, self._refusal = now_ns, why
        if why.startswith(JUMPED):
            self._jumps_ns.append(now_ns)
            spread_ms = (now_ns - self._jumps_ns[0]) / 1e6
            self._untrusted |= len(self._jumps_ns) == _JUMPS and spread_ms <= _STEADY_MS

    def arm(self, t_ns: int) -> None:
        """Take note of the stamp of a pose of the arm."""
        self._arm_ns = t_ns

    def arm_is_fresh(self, now_ns: int) -> bool:
        """Return whether the arm has reported its pose recently."""
        return self._arm_ns is not None and (now_ns - self._arm_ns) / 1e6 <= self._s.hold_ms

    def trouble(self, now_ns: int, away_ms: float) -> Trouble:
        """Return the worst trouble there is; ``away_ms`` is how long ago the caller last asked."""
        return max(
            self.with_poses(now_ns), self._with_arm(now_ns), self._with_caller(away_ms), key=lambda t: t.level
        )

    def with_poses(self, now_ns: int) -> Trouble:
        """Return the trouble with the poses alone."""
        s = self._s
        age_ms = None if self._believed_ns is None else (now_ns - self._believed_ns) / 1e6
        refused = self._refused_ns is not None and (now_ns - self._refused_ns) / 1e6 <= s.hold_ms
        if age_ms is None:
            text = f"the last one: {self._refusal}" if refused else "is the tracker on?"
            return Trouble(Level.LOSE, f"there was no pose yet; {text}", silent=not refused)
        if age_ms <= s.hold_ms:
            return self._with_jumps(now_ns)
        if refused:
            level = Level.LOSE if age_ms > s.lost_ms else Level.HOLD
            return Trouble(level, f"the forearm is lost: {self._refusal}")
        return self._by_age(age_ms, "no pose came", silent=True)

    def _with_jumps(self, now_ns: int) -> Trouble:
        """Report a tracker that jumps away and back: poses between jumps are not accepted either."""
        if self._untrusted and (now_ns - self._jumps_ns[-1]) / 1e6 > _STEADY_MS:
            self.forget_jumps()
        if not self._untrusted:
            return Trouble(Level.NONE, "")
        return Trouble(Level.HOLD, f"the tracker has no vote: {self._refusal}, {_JUMPS} times and more")

    def _with_arm(self, now_ns: int) -> Trouble:
        if self._arm_ns is None:
            return Trouble(Level.LOSE, "the arm has not reported its position yet")
        age_ms = (now_ns - self._arm_ns) / 1e6
        if age_ms <= self._s.hold_ms:
            return Trouble(Level.NONE, "")
        return self._by_age(age_ms, "the arm did not report its position")

    def _with_caller(self, away_ms: float) -> Trouble:
        if away_ms <= self._s.late_ms:
            return Trouble(Level.NONE, "")
        level = Level.LOSE if away_ms > self._s.silent_ms else Level.HOLD
        return Trouble(level, f"the loop was away for {away_ms:.0f} ms")

    def _by_age(self, age_ms: float, subject: str, *, silent: bool = False) -> Trouble:
        s = self._s
        steps = ((Level.STOP, s.stop_ms), (Level.LOSE, s.silent_ms), (Level.HOLD, s.hold_ms))
        level, over_ms = next(step for step in steps if age_ms > step[1])
        return Trouble(level, f"{subject} for more than {over_ms:g} ms", silent)
