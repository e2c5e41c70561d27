"""Define the messages of an Allegro Hand's CAN frames, as small frozen records.

Fingers go by name; counts and temperatures are those of the finger's joints 0 to 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, NamedTuple, TypeAlias

from tega._native import ALLEGRO_RAD_PER_COUNT

Finger: TypeAlias = Literal["index", "middle", "ring", "thumb"]
"""A finger's name."""

HAND_FINGERS: Final[tuple[Finger, Finger, Finger, Finger]] = ("index", "middle", "ring", "thumb")
"""The fingers in the hand's order: number 0 to 3 on the wire, joints ``4 * number`` onwards."""

Counts: TypeAlias = tuple[int, int, int, int]
"""One finger's joints 0 to 3, signed 16 bits each."""


class CanFrame(NamedTuple):
    """A classic CAN frame with an 11-bit identifier.

    Attributes:
        id: The identifier, 0 to 0x7FF.
        data: The payload, 0 to 8 bytes.
        remote: Whether it asks for the data frame of the same identifier.
    """

    id: int
    data: bytes
    remote: bool = False


Reason: TypeAlias = Literal["error", "extended", "remote", "foreign_device", "unknown", "malformed"]
"""Why a frame was not decoded: a controller's error frame, a 29-bit identifier, a request, another hand's frame, a
message the hand does not have, or a known one of the wrong length."""


@dataclass(frozen=True, slots=True)
class AllegroPosition:
    """One finger's joint positions in encoder counts, from the hand."""

    finger: Finger
    counts: Counts

    @property
    def angles_rad(self) -> tuple[float, float, float, float]:
        """Joint angles of a version 4 hand, rad."""
        a, b, c, d = self.counts
        k = ALLEGRO_RAD_PER_COUNT
        return (a * k, b * k, c * k, d * k)


@dataclass(frozen=True, slots=True)
class AllegroTemperature:
    """One finger's joint temperatures, °C, from the hand; None where a sensor does not answer."""

    finger: Finger
    celsius: tuple[int | None, int | None, int | None, int | None]


@dataclass(frozen=True, slots=True)
class AllegroInfo:
    """Versions, side, temperature and status of a hand, from the hand.

    Sources agree about status bits 0 and 1 only. Bits 2 to 4 have two readings, by firmware: a communication
    fault or thermal throttling (2), a communication fault (3), a palm too hot (4). ``must_stop`` and
    ``must_warn`` take the careful side of both.

    Attributes:
        hardware: Version, (4, 2) for "4.2".
        side: "unknown" for a value that is neither.
        palm_c: Palm board, °C.
        status: Status bits as sent.
    """

    hardware: tuple[int, int]
    firmware: tuple[int, int]
    side: Literal["right", "left", "unknown"]
    palm_c: int
    status: int

    @property
    def servo_on(self) -> bool:
        """Whether the motors are on (bit 0)."""
        return bool(self.status & 0b00001)

    @property
    def must_stop(self) -> bool:
        """Whether something is too hot in either reading (bits 1 and 4): send zero torque."""
        return bool(self.status & 0b10010)

    @property
    def must_warn(self) -> bool:
        """Whether bits 2 or 3 are set, throttling or bad communication: lower the torque."""
        return bool(self.status & 0b01100)


@dataclass(frozen=True, slots=True)
class AllegroSerial:
    """The serial number's eight characters, trailing zeros removed, anything unprintable escaped.

    On the label it stands behind "SAH040".
    """

    text: str


@dataclass(frozen=True, slots=True)
class AllegroImu:
    """The inertial unit's three or four words, signed 16 bits each. Neither meaning nor scale is known."""

    words: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class AllegroStatus:
    """A STATUS message. What its bytes mean is not known."""

    data: bytes


@dataclass(frozen=True, slots=True)
class AllegroServo:
    """SERVO ON or SERVO OFF, from a host."""

    on: bool


@dataclass(frozen=True, slots=True)
class AllegroTorque:
    """One finger's pulse widths, 1200 counts for one tau, from a host."""

    finger: Finger
    counts: Counts


@dataclass(frozen=True, slots=True)
class AllegroPeriod:
    """Periods at which the hand is to report by itself, from a host; 0 is never, None the six-byte form."""

    position_ms: int
    imu_ms: int
    temperature_ms: int
    status_ms: int | None


@dataclass(frozen=True, slots=True)
class AllegroPose:
    """A SET POSE of another program, in encoder counts. Version 4 firmware has none, so there is no encoder."""

    finger: Finger
    counts: Counts


@dataclass(frozen=True, slots=True)
class AllegroConfig:
    """A CONFIG of another program: six bytes for the hand's flash memory. There is no encoder, on purpose."""

    data: bytes


@dataclass(frozen=True, slots=True)
class AllegroRejected:
    """A frame that was not decoded. No reason is fatal: count them."""

    reason: Reason


@dataclass(frozen=True, slots=True)
class AllegroRequest:
    """Request to a hand in a remote frame; ``finger`` for positions and temperatures."""

    wants: Literal["info", "serial", "imu", "position", "temperature"]
    finger: Finger | None


AllegroMessage: TypeAlias = (
    AllegroPosition
    | AllegroTemperature
    | AllegroInfo
    | AllegroSerial
    | AllegroImu
    | AllegroStatus
    | AllegroServo
    | AllegroTorque
    | AllegroPeriod
    | AllegroPose
    | AllegroConfig
    | AllegroRejected
)
"""Result of :func:`tega.wire.allegro_decode`."""
