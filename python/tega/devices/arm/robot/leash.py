"""Decide which commands the arm obeys and how it reacts to silence, and define the body that is led.

The leash is pure, without clock or arm; the body is a robot, or a simulation of one.
"""

from __future__ import annotations

from typing import Literal, NamedTuple, Protocol

from tega.arm.messages import ArmTargetWords, HandSeen, Quaternion, Triple
from tega.arm.settings import WatchdogSettings

# The clocks are one on one machine; more than this is no delay of a thread.
_AHEAD_MS = 20.0


class Order(NamedTuple):
    """Order to the arm: follow, hold or rest.

    Attributes:
        kind: ``follow`` the command, ``hold`` where it is, or ``rest`` without force.
        reason: Why it does not follow; ``""`` if it does.
        requested: The command to follow.
    """

    kind: Literal["follow", "hold", "rest"]
    reason: str
    requested: ArmTargetWords | None = None


class Leash:
    """Judges commands by session, number, age and hold, the layered times of ``docs/arm.md``, at the robot.

    Without a command for ``hold_ms`` the arm holds its position; after ``silent_ms`` the operator has to
    engage again; after ``stop_ms`` the arm rests. A burst of old commands moves nothing, since each command
    is judged by the time at which it was made. The times are the chain's own, so that both ends agree.
    """

    def __init__(self, session: int) -> None:
        self._session, self._s = session, WatchdogSettings()
        self._last: ArmTargetWords | None = None
        self._sequence = -1
        self._engagements = 0
        self._lost_at: int | None = None  # engagements that do not count any more
        self._rests = True
        self.refused = 0
        self.refusal = ""

    def take(self, requested: ArmTargetWords, now_ns: int) -> str:
        """Take in a command; return why it is not obeyed, ``""`` if it is."""
        age_ms = (now_ns - requested.t_ns) / 1e6
        text = ""
        if requested.session != self._session:
            text = "it is of another session"
        elif requested.sequence <= self._sequence:
            text = f"number {requested.sequence} came after {self._sequence}"
        elif age_ms > self._s.hold_ms:
            text = f"it is {age_ms:.0f} ms old"
        elif age_ms < -_AHEAD_MS:
            text = f"it lies {-age_ms:.0f} ms in the future"
        elif requested.engagements < self._engagements:
            text = f"it is of hold {requested.engagements}, before {self._engagements}"
        else:
            text = requested.malformed()
        if text:
            self.refused, self.refusal = self.refused + 1, text
            return text
        self._age(now_ns)
        self._last, self._sequence, self._engagements = requested, requested.sequence, requested.engagements
        if self._lost_at is not None and requested.engagements > self._lost_at:
            self._lost_at = None
        return ""

    def lose(self) -> None:
        """Ignore all commands until the operator engages again, as after a fault."""
        self._lost_at, self._rests = self._engagements, True

    def order(self, now_ns: int) -> Order:
        """Return the order to the arm now: follow, hold or rest."""
        age_ms = self._age(now_ns)
        last = self._last
        if last is None:
            return Order("rest", "no command yet")
        if age_ms > self._s.stop_ms:
            self._rests = True
            return Order("rest", f"no command for more than {self._s.stop_ms:g} ms")
        if last.state == "stopped" or last.place is None:
            self._rests = True
            return Order(
                "rest", "it was stopped" if last.state == "stopped" else "the operator has not taken hold yet"
            )
        if self._lost_at is not None:
            return Order("rest" if self._rests else "hold", "the operator has to take hold again")
        if age_ms > self._s.hold_ms:
            return Order(
                "rest" if self._rests else "hold", f"no command for more than {self._s.hold_ms:g} ms"
            )
        self._rests = False
        return Order("follow", "", last)

    def _age(self, now_ns: int) -> float:
        """Return how old the newest command is, and lose hold of the arm if that is too much."""
        if self._last is None:
            return 0.0
        age_ms = (now_ns - self._last.t_ns) / 1e6
        if age_ms > self._s.silent_ms and self._lost_at is None:
            self._lost_at = self._engagements
        return age_ms


class RobotBody(Protocol):
    """An arm that is led. Only :meth:`open`, :meth:`recover` and :meth:`close` may take longer than a tick.

    ``facts`` are about the arm, one line each. ``success_rate`` is the share of commands that the robot
    itself took in time; ``None`` where it does not report it.
    """

    facts: tuple[str, ...] = ()
    success_rate: float | None = None

    def open(self) -> None:
        """Connect to the arm that the settings ask for; nothing moves but what its options ask for."""

    def observe(self) -> HandSeen:
        """Return place and turn of the hand."""

    def begin(self) -> None:
        """Begin to follow, with the present pose as the first target."""

    def lead(self, place: Triple, turn: Quaternion, velocity_m_s: Triple, velocity_rad_s: Triple) -> None:
        """Give the arm its next target."""

    def rest(self) -> None:
        """Begin to come to rest, with damping and without force; returns at once."""

    @property
    def in_control(self) -> bool:
        """Whether the arm still follows or comes to rest."""

    def fault(self) -> str:
        """Return the fault that stopped the arm or keeps it from moving, ``""`` for none."""
        return ""

    def recover(self) -> str:
        """Clear a fault that a person has seen; return the remaining fault, ``""`` if there is none."""
        return ""

    def close(self) -> None:
        """Come to rest and let go."""
