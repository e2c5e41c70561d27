"""Define the body that the arm's process leads: a robot, or a simulation of one."""

from __future__ import annotations

from tega.arm.messages import HandSeen, Quaternion, Triple


class RobotBody:
    """An arm that is led. Only :meth:`open`, :meth:`recover` and :meth:`close` may take longer than a tick.

    ``facts`` are about the arm, one line each. ``success_rate`` is the share of commands that the robot
    itself took in time; ``None`` where it does not report it.
    """

    facts: tuple[str, ...] = ()
    success_rate: float | None = None

    def open(self) -> None:
        """Connect to the arm that the settings ask for; nothing moves but what its options ask for."""
        raise NotImplementedError

    def observe(self) -> HandSeen:
        """Return place and turn of the hand."""
        raise NotImplementedError

    def begin(self) -> None:
        """Begin to follow, with the present pose as the first target."""
        raise NotImplementedError

    def lead(self, place: Triple, turn: Quaternion, velocity_m_s: Triple, velocity_rad_s: Triple) -> None:
        """Give the arm its next target."""
        raise NotImplementedError

    def rest(self) -> None:
        """Begin to come to rest, with damping and without force; returns at once."""
        raise NotImplementedError

    @property
    def in_control(self) -> bool:
        """Whether the arm still follows or comes to rest."""
        raise NotImplementedError

    def fault(self) -> str:
        """Return the fault that stopped the arm or keeps it from moving, ``""`` for none."""
        return ""

    def recover(self) -> str:
        """Clear a fault that a person has seen; return the remaining fault, ``""`` if there is none."""
        return ""

    def close(self) -> None:
        """Come to rest and let go."""
        raise NotImplementedError
