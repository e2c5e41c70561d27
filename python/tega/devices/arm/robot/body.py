"""Define the body that the arm's process leads: a robot, or a simulation of one."""

from __future__ import annotations

from typing import NamedTuple, Protocol

from tega.arm.messages import Quaternion, Triple


class HandSeen(NamedTuple):
    """Place and turn of the robot's hand, with their time.

    Attributes:
        t_ns: When it was there, monotonic clock; does not rise while the robot says nothing new.
        place: Metres, base's axes.
        turn: x, y, z, w.
    """

    t_ns: int
    place: Triple
    turn: Quaternion


class RobotBody(Protocol):
    """An arm that is led. Only :meth:`open`, :meth:`recover` and :meth:`close` may take longer than a tick."""

    facts: tuple[str, ...]

    def open(self) -> None:
        """Connect; nothing moves but what its options ask for.

        Raises:
            TegaError: It is not there, or not the one that the settings ask for.
        """
        ...

    def observe(self) -> HandSeen:
        """Return place and turn of the hand."""
        ...

    def begin(self) -> None:
        """Begin to follow, with the present pose as the first target."""
        ...

    def lead(self, place: Triple, turn: Quaternion, velocity_m_s: Triple, velocity_rad_s: Triple) -> None:
        """Give the arm its next target."""
        ...

    def rest(self) -> None:
        """Begin to come to rest, with damping and without force; returns at once."""
        ...

    @property
    def in_control(self) -> bool:
        """Whether the arm still follows or comes to rest."""
        ...

    def fault(self) -> str:
        """Return the fault that stopped the arm or keeps it from moving, ``""`` for none."""
        ...

    def recover(self) -> str:
        """Clear a fault that a person has seen; return the remaining fault, ``""`` if there is none."""
        ...

    @property
    def success_rate(self) -> float | None:
        """Share of the commands that the robot itself took in time."""
        ...

    def close(self) -> None:
        """Come to rest and let go."""
        ...
