"""Define and decode the messages between a run and the arm's process; msgpack, one message a datagram."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import msgspec

from tega.arm.pose import ArmState

Phase = Literal["ready", "following", "resting", "faulted"]
Triple = tuple[float, float, float]
Quaternion = tuple[float, float, float, float]


class ArmTargetWords(msgspec.Struct, frozen=True, tag="Asked"):
    """Target of the robot's hand, from the run to the arm's process.

    Attributes:
        session: Session of the command; the arm obeys one session only.
        sequence: Its number, rising.
        t_ns: When it was made, monotonic clock.
        engagements: How often the operator has taken hold.
        place: Metres; ``None`` asks nothing of the arm.
        turn: x, y, z, w.
    """

    session: int
    sequence: int
    t_ns: int
    state: ArmState
    engagements: int
    place: Triple | None = None
    turn: Quaternion | None = None
    velocity_m_s: Triple = (0.0, 0.0, 0.0)
    velocity_rad_s: Triple = (0.0, 0.0, 0.0)

    def malformed(self) -> str:
        """Return why the target cannot be followed, ``""`` if it can."""
        if (self.place is None) != (self.turn is None):
            return "it has a place or a turn, but not both"
        numbers = (*(self.place or ()), *(self.turn or ()), *self.velocity_m_s, *self.velocity_rad_s)
        if not all(map(math.isfinite, numbers)):
            return "a number in it is not finite"
        if self.turn is not None and abs(math.hypot(*self.turn) - 1) > 1e-3:
            return f"its quaternion has length {math.hypot(*self.turn):.4g}, not 1"
        return ""


class Recover(msgspec.Struct, frozen=True, tag=True):
    """A person has seen that it is safe: clear the fault."""


class ArmShutdown(msgspec.Struct, frozen=True, tag="Leave"):
    """Let the arm come to rest, and end."""


class Health(msgspec.Struct, frozen=True):
    """Rate, delays and refusals of the arm's loop, over its last second.

    Attributes:
        worst_ms: The longest time between two ticks.
        late: Ticks in all that came after more than two periods.
        refused: Commands in all that were not obeyed.
        success_rate: Share of commands that the robot took in time; ``None`` where it does not report it.
    """

    rate_hz: float = 0.0
    worst_ms: float = 0.0
    late: int = 0
    refused: int = 0
    success_rate: float | None = None


class HandSeen(NamedTuple):
    """Place and turn (x, y, z, w) of the robot's hand, or of its target, in metres and the base's axes.

    ``t_ns`` is when it was there, monotonic clock; it does not rise while the robot sends nothing new.
    """

    t_ns: int
    place: Triple
    turn: Quaternion


class ArmStatusWords(msgspec.Struct, frozen=True, tag="Told"):
    """Pose of the robot's hand and state of the arm, from the arm's process to the run.

    ``reason`` belongs to ``phase``; ``refusal`` is why the last command that was not obeyed was not. ``led``
    is its newest target, after everything that limits it; ``None`` while it is not led.
    """

    seen: HandSeen
    phase: Phase
    reason: str
    refusal: str = ""
    health: Health = Health()
    led: HandSeen | None = None


class Ready(msgspec.Struct, frozen=True, tag=True):
    """The arm is there; ``facts`` are about it, one line each, such as its versions."""

    facts: tuple[str, ...]


class Failed(msgspec.Struct, frozen=True, tag=True):
    """The arm could not be opened; ``kind`` is the name of the error's class in :mod:`tega.errors`."""

    kind: str
    message: str
    hint: str


Message = ArmTargetWords | Recover | ArmShutdown | ArmStatusWords | Ready | Failed
_decoder = msgspec.msgpack.Decoder(Message)
encode = msgspec.msgpack.Encoder().encode


def decode(data: bytes) -> Message:
    """Decode a message of the run or of the arm's process; raises ``msgspec.DecodeError``."""
    message: Message = _decoder.decode(data)
    return message
