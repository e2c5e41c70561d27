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


@dataclass(frozen=True, slots=True)
class AllegroPosition:
    """One finger's joint positions, from the hand.

    Attributes:
        finger: The finger.
        counts: Encoder counts.
    """

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
    """One finger's joint temperatures, from the hand.

    Attributes:
        finger: The finger.
        celsius: °C; None where the sensor does not answer (above 120 on the wire).
    """

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
        firmware: Version, likewise.
        side: "right" or "left"; "unknown" for a value neither.
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

    Attributes:
        text: The number as sent; on the label it stands behind "SAH040".
    """

    text: str


@dataclass(frozen=True, slots=True)
class AllegroImu:
    """The inertial unit's three or four words. Neither their meaning nor their scale is known.

    Attributes:
        words: Signed 16 bits each.
    """

    words: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class AllegroStatus:
    """A STATUS message. What its bytes mean is not known.

    Attributes:
        data: The payload.
    """

    data: bytes


@dataclass(frozen=True, slots=True)
class AllegroServo:
    """Motors on or off, from a host.

    Attributes:
        on: Whether it is SERVO ON.
    """

    on: bool


@dataclass(frozen=True, slots=True)
class AllegroTorque:
    """One finger's pulse widths, from a host.

    Attributes:
        finger: The finger.
        counts: Pulse-width counts, 1200 for one tau.
    """

    finger: Finger
    counts: Counts


@dataclass(frozen=True, slots=True)
class AllegroPeriod:
    """Period at which the hand is to report by itself, from a host; 0 is never.

    Attributes:
        position_ms: Joint positions.
        imu_ms: Inertial unit.
        temperature_ms: Joint temperatures.
        status_ms: Status; None in the six-byte form.
    """

    position_ms: int
    imu_ms: int
    temperature_ms: int
    status_ms: int | None


@dataclass(frozen=True, slots=True)
class AllegroPose:
    """A SET POSE of another program. Version 4 firmware does not implement it, so there is no encoder.

    Attributes:
        finger: The finger.
        counts: Encoder counts.
    """

    finger: Finger
    counts: Counts


@dataclass(frozen=True, slots=True)
class AllegroConfig:
    """A CONFIG of another program, which writes the hand's flash memory. There is no encoder, on purpose.

    Attributes:
        data: The payload, six bytes in one of two layouts.
    """

    data: bytes


@dataclass(frozen=True, slots=True)
class AllegroRejected:
    """A frame that was not decoded. None of these is fatal: count them.

    Attributes:
        reason: "error" for a controller's error frame, "extended" for a 29-bit identifier, "remote" for a
            request, "foreign_device" for another hand's, "unknown" for a message the hand does not have,
            "malformed" for a known one of the wrong length.
    """

    reason: Literal["error", "extended", "remote", "foreign_device", "unknown", "malformed"]


@dataclass(frozen=True, slots=True)
class AllegroRequest:
    """Request to a hand in a remote frame.

    Attributes:
        wants: Kind of report.
        finger: Finger concerned, for positions and temperatures.
    """

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
