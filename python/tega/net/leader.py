"""Who leads the robot: one operator at a time, the first."""

from __future__ import annotations

from collections.abc import Sequence

from tega.net.messages import PROTOCOL, Join, Refused

__all__ = ["Leadership"]

# An operator who has asked but whose sign of life has not come by then has gone again.
_SIGN_NS = 1_000_000_000


class Leadership:
    """Gives the lead to the first who asks, until that operator's sign of life is gone; no clock, no thread.

    Args:
        robot: The robot's name.
        operators: Who may lead; nobody named means anybody.
        frame: Axes in which the arm's poses are wanted; ``""`` without an arm.
        hand: Whether there is a hand to be closed.

    Attributes:
        session: Of the leader; 0 for none.
        name: The leader's name.
    """

    def __init__(
        self, robot: str, *, operators: Sequence[str] = (), frame: str = "", hand: bool = True
    ) -> None:
        self._robot, self._operators, self._frame, self._hand = robot, tuple(operators), frame, hand
        self.session, self.name = 0, ""
        self._since_ns = 0
        self._alive: set[tuple[str, int]] = set()

    def ask(self, join: Join, now_ns: int) -> Refused | None:
        """Take in that somebody wants to lead; return why not, ``None`` if it is so."""
        self.look(now_ns)
        if (refused := self._refusal(join)) is not None:
            return refused
        if self.session == 0:
            self.session, self.name, self._since_ns = join.session, join.name, now_ns
        return None

    def _refusal(self, join: Join) -> Refused | None:
        robot = self._robot
        if join.protocol != PROTOCOL:
            return Refused(
                f"robot {robot!r} speaks protocol {PROTOCOL}, this station {join.protocol}",
                "install the same version of TEGA on both machines",
            )
        if join.session <= 0:
            return Refused("a session's number has to be above 0")
        if self._operators and join.name not in self._operators:
            return Refused(
                f"robot {robot!r} may not be led by {join.name!r}",
                "name it in net.operators of the robot's settings",
            )
        if self.session not in {0, join.session}:
            return Refused(
                f"robot {robot!r} is led by {self.name!r} already",
                f"ask {self.name!r} to end, then start again",
            )
        return self._lacking(join)

    def _lacking(self, join: Join) -> Refused | None:
        """Return what the station lacks that this robot needs."""
        robot, frame = self._robot, self._frame
        if self._hand and not join.muscles:
            return Refused(f"robot {robot!r} has a hand, and this station has no EMG", "set [emg]")
        if frame and not join.dead_man:
            return Refused(
                f"robot {robot!r} has an arm, and this station has no dead-man switch", "set [input.dead_man]"
            )
        if frame and join.frame != frame:
            said = (
                f"gives poses in the axes {join.frame!r}" if join.frame else "has nothing that leads an arm"
            )
            return Refused(
                f"robot {robot!r} has an arm that wants poses in the axes {frame!r}; this station {said}",
                "set [net.tracker] or [input.motion] here, or arm.mapping.frame in the robot's settings",
            )
        return None

    def sign(self, name: str, session: int, *, alive: bool) -> bool:
        """Take in a sign of life, or its end; return whether the leader has gone."""
        if alive:
            self._alive.add((name, session))
            return False
        self._alive.discard((name, session))
        if session != self.session or name != self.name:
            return False
        self._free()
        return True

    def look(self, now_ns: int) -> bool:
        """Return whether the leader has gone without ever having given a sign of life."""
        if (
            self.session == 0
            or (self.name, self.session) in self._alive
            or now_ns - self._since_ns <= _SIGN_NS
        ):
            return False
        self._free()
        return True

    def _free(self) -> None:
        self.session, self.name = 0, ""
