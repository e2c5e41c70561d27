"""Watch the time since the last poses and arm reports, and decide the consequence."""

from __future__ import annotations

from collections import deque
from enum import IntEnum
from typing import NamedTuple

from tega.arm.gate import JUMPED
from tega.arm.settings import WatchdogSettings

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
            self.with_poses(now_ns),
            self._with_arm(now_ns),
            self._with_caller(away_ms),
            key=lambda t: t.level,
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
