"""Decode an Allegro Hand's CAN frames from the bus to records."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Literal

from tega import _native
from tega.wire.allegro_messages import (
    HAND_FINGERS,
    AllegroConfig,
    AllegroImu,
    AllegroInfo,
    AllegroMessage,
    AllegroPeriod,
    AllegroPose,
    AllegroPosition,
    AllegroRejected,
    AllegroRequest,
    AllegroSerial,
    AllegroServo,
    AllegroStatus,
    AllegroTemperature,
    AllegroTorque,
    CanFrame,
    Counts,
    Finger,
)
from tega.wire.arrays import as_bytes

_TEMPERATURE_VALID_MAX_C: Final = 120


def allegro_decode(
    frame: CanFrame, *, device_id: int = 0, extended: bool = False, error: bool = False
) -> AllegroMessage:
    """Decode a frame from the bus.

    No frame from a bus raises: a frame that is not a message of this hand is returned as :class:`AllegroRejected`
    with the reason for the rejection.

    Args:
        frame: Identifier, payload, and whether it is a remote frame.
        device_id: Our hand's number.
        extended: Whether the identifier has 29 bits.
        error: Whether it is the controller's error frame.

    Raises:
        WireError: For a device number above 3.

    Example:
        >>> allegro_decode(CanFrame(0x080, bytes.fromhex("CA FD BD FE 90 FF CE FF")))
        AllegroPosition(finger='index', counts=(-566, -323, -112, -50))
        >>> allegro_decode(CanFrame(0x080, b"", remote=True))
        AllegroRejected(reason='remote')
    """
    can_id, data, remote = frame
    kind, finger, values = _native.allegro_decode(
        can_id, as_bytes(data), device_id=device_id, remote=remote, extended=extended, error=error
    )
    return _DECODED[kind](HAND_FINGERS[finger], values)


def allegro_requested(frame: CanFrame, *, device_id: int = 0) -> AllegroRequest | None:
    """Decode a remote frame to its request to hand `device_id`, or None: for a simulated hand.

    Raises:
        WireError: For a device number above 3.
    """
    request = _native.allegro_requested(frame.id, device_id=device_id) if frame.remote else None
    if request is None:
        return None
    wants, finger = request
    return AllegroRequest(wants, None if finger is None else HAND_FINGERS[finger])


def _four(values: list[int]) -> Counts:
    a, b, c, d = values
    return (a, b, c, d)


def _temperature(finger: Finger, values: list[int]) -> AllegroTemperature:
    a, b, c, d = (value if value <= _TEMPERATURE_VALID_MAX_C else None for value in values)
    return AllegroTemperature(finger, (a, b, c, d))


def _info(_finger: Finger, values: list[int]) -> AllegroInfo:
    hardware, firmware, side, palm_c, status = values
    sides: dict[int, Literal["right", "left"]] = {0: "right", 1: "left"}
    return AllegroInfo(
        divmod(hardware, 256), divmod(firmware, 256), sides.get(side, "unknown"), palm_c, status
    )


def _serial(_finger: Finger, values: list[int]) -> AllegroSerial:
    text = bytes(values).rstrip(b"\0").decode("ascii", "backslashreplace")
    return AllegroSerial("".join(c if c.isprintable() else f"\\x{ord(c):02x}" for c in text))


def _period(_finger: Finger, values: list[int]) -> AllegroPeriod:
    position_ms, imu_ms, temperature_ms, *status = values
    return AllegroPeriod(position_ms, imu_ms, temperature_ms, status[0] if status else None)


_DECODED: Final[dict[str, Callable[[Finger, list[int]], AllegroMessage]]] = {
    "position": lambda finger, values: AllegroPosition(finger, _four(values)),
    "temperature": _temperature,
    "info": _info,
    "serial": _serial,
    "imu": lambda _finger, values: AllegroImu(tuple(values)),
    "status": lambda _finger, values: AllegroStatus(bytes(values)),
    "servo_on": lambda _finger, _values: AllegroServo(on=True),
    "servo_off": lambda _finger, _values: AllegroServo(on=False),
    "set_torque": lambda finger, values: AllegroTorque(finger, _four(values)),
    "set_period": _period,
    "set_pose": lambda finger, values: AllegroPose(finger, _four(values)),
    "config": lambda _finger, values: AllegroConfig(bytes(values)),
    "error": lambda _finger, _values: AllegroRejected("error"),
    "extended": lambda _finger, _values: AllegroRejected("extended"),
    "remote": lambda _finger, _values: AllegroRejected("remote"),
    "foreign_device": lambda _finger, _values: AllegroRejected("foreign_device"),
    "unknown": lambda _finger, _values: AllegroRejected("unknown"),
    "malformed": lambda _finger, _values: AllegroRejected("malformed"),
}
