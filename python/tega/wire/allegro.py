"""Encode and decode CAN frames of an Allegro Hand: version 4 in full, 3 and 5 as far as their numbers are known.

Joints are in the hand's order everywhere: index 0 to 3, middle 4 to 7, ring 8 to 11, thumb 12 to 15. There is
no encoder for CONFIG, which writes the hand's flash memory, nor for SET POSE, which version 4 firmware does
not have. ``device_id`` is everywhere the hand's number on its bus, 0 from the factory; one above 3 raises
``WireError``, a finger that the hand has not ``InvalidValueError``.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Final, Literal, get_args

import numpy as np
from numpy.typing import ArrayLike, NDArray

from tega import _native
from tega.errors import InvalidValueError, WireError
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
    Reason,
)
from tega.wire.arrays import as_bytes, float_array, integer_array

_TEMPERATURE_NO_ANSWER: Final = 0xFF
_TEMPERATURE_VALID_MAX_C: Final = 120


def allegro_torque_frames(
    torques: ArrayLike, *, device_id: int = 0, version: Literal[4, 5] = 4
) -> list[CanFrame]:
    """Encode one control step: SET TORQUE for index, middle, ring and thumb.

    Counts are ``torque * 1200`` (version 5: 1430), clamped to each joint's limit (:data:`ALLEGRO_PWM_LIMITS`;
    version 5: 240) and rounded to nearest, halves away from zero. The vendor's drivers truncate, so they send
    up to one count less.

    Args:
        torques: (16,) torques in tau units, 1.0 being full pulse width; float64 is not copied.
        device_id: The hand's number.
        version: The hand's; counts of one mean nothing to the other.

    Raises:
        ShapeError: Unless there are 16.
        DtypeError: If they are not real numbers.
        WireError: If any is NaN or infinite; no frame is made then.

    Example:
        >>> [hex(frame.id) for frame in allegro_torque_frames([0.0] * 16, device_id=1)]
        ['0x181', '0x185', '0x189', '0x18d']
    """
    tau = float_array("torques", torques, (16,))
    frames = _native.allegro_torque_frames(tau, device_id=device_id, version=version)
    return [CanFrame(can_id, data) for can_id, data in frames]


def allegro_angles_rad(counts: ArrayLike, *, version: Literal[4, 5] = 4) -> NDArray[np.float64]:
    """Return joint angles in rad of encoder counts (signed 16 bits), in the same shape.

    Raises:
        DtypeError: If the counts are not integers.
        WireError: If one does not fit 16 bits.

    Example:
        >>> allegro_angles_rad([8848]).round(6)
        array([0.785376])
    """
    words = integer_array("counts", counts, np.int16, (-32768, 32767))
    return _native.allegro_angles_rad(words.ravel(), version=version).reshape(words.shape)


def allegro_angle_counts(angles_rad: ArrayLike, *, version: Literal[4, 5] = 4) -> NDArray[np.int16]:
    """Return the nearest encoder counts of joint angles in rad, in the same shape.

    Raises:
        DtypeError: If the angles are not real numbers.
        WireError: If one is NaN or beyond 16 bits (±2.9085 rad in version 4).
    """
    angles = float_array("angles_rad", angles_rad)
    return _native.allegro_angle_counts(angles.ravel(), version=version).reshape(angles.shape)


def allegro_servo_on(*, device_id: int = 0) -> CanFrame:
    """Return the frame that switches the motors on."""
    return _encode("servo_on", device_id=device_id)


def allegro_servo_off(*, device_id: int = 0) -> CanFrame:
    """Return the frame that switches the motors off; send zero torque first, as some firmware ignores it."""
    return _encode("servo_off", device_id=device_id)


def allegro_limp_frames(*, device_id: int = 0) -> list[CanFrame]:
    """Return the frames that leave a hand without force: zero torque on every finger, then SERVO OFF."""
    return [*allegro_torque_frames(np.zeros(16), device_id=device_id), allegro_servo_off(device_id=device_id)]


def allegro_set_period(
    position_ms: int,
    imu_ms: int = 0,
    temperature_ms: int = 0,
    status_ms: int | None = 0,
    *,
    device_id: int = 0,
) -> CanFrame:
    """Return the frame that sets how often the hand reports by itself; 0 is never, all 0 stops it.

    Args:
        position_ms: Joint positions, 3 in every known driver.
        imu_ms: Inertial unit.
        temperature_ms: Joint temperatures.
        status_ms: Status; None for the six-byte form, which the vendor's own drivers send.
        device_id: The hand's number.

    Raises:
        WireError: If a period is outside 0 to 65535 ms.
    """
    status = [] if status_ms is None else [status_ms]
    return _encode("set_period", values=[position_ms, imu_ms, temperature_ms, *status], device_id=device_id)


def allegro_request_info(*, device_id: int = 0) -> CanFrame:
    """Return the remote frame that asks for :class:`AllegroInfo`."""
    return _encode("request_info", device_id=device_id)


def allegro_request_serial(*, device_id: int = 0) -> CanFrame:
    """Return the remote frame that asks for :class:`AllegroSerial`."""
    return _encode("request_serial", device_id=device_id)


def allegro_request_imu(*, device_id: int = 0) -> CanFrame:
    """Return the remote frame that asks for :class:`AllegroImu`."""
    return _encode("request_imu", device_id=device_id)


def allegro_request_position(finger: Finger, *, device_id: int = 0) -> CanFrame:
    """Return the remote frame that asks for one finger's :class:`AllegroPosition`."""
    return _encode("request_position", finger, device_id=device_id)


def allegro_request_temperature(finger: Finger, *, device_id: int = 0) -> CanFrame:
    """Return the remote frame that asks for one finger's :class:`AllegroTemperature`."""
    return _encode("request_temperature", finger, device_id=device_id)


def allegro_position_frames(
    angles_rad: ArrayLike, *, device_id: int = 0, version: Literal[4, 5] = 4
) -> list[CanFrame]:
    """Encode the four position frames that a hand with joint angles (16,), rad, sends.

    ``ShapeError`` unless there are 16, ``WireError`` if one is NaN or does not fit.
    """
    counts = allegro_angle_counts(float_array("angles_rad", angles_rad, (16,)), version=version)
    rows: list[list[int]] = counts.reshape(4, 4).tolist()
    return [
        _encode("position", finger, row, device_id=device_id)
        for finger, row in zip(HAND_FINGERS, rows, strict=True)
    ]


def allegro_report_frame(
    report: AllegroPosition | AllegroTemperature | AllegroInfo | AllegroSerial | AllegroImu | AllegroStatus,
    *,
    device_id: int = 0,
) -> CanFrame:
    """Encode a report of the hand, for a simulated hand. :func:`allegro_decode` is the inverse.

    ``WireError`` if a value does not fit its field, ``ShapeError`` for more or fewer values than the message holds.
    """
    match report:
        case AllegroPosition(finger, counts):
            return _encode("position", finger, counts, device_id=device_id)
        case AllegroTemperature(finger, celsius):
            values = [_TEMPERATURE_NO_ANSWER if value is None else value for value in celsius]
            return _encode("temperature", finger, values, device_id=device_id)
        case AllegroInfo(hardware, firmware, side, palm_c, status):
            sides = {"right": 0, "left": 1, "unknown": 0xFF}
            words = [(major << 8) + minor for major, minor in (hardware, firmware)]
            return _encode("info", values=[*words, sides[side], palm_c, status], device_id=device_id)
        case AllegroSerial(text):
            if not text.isascii() or len(text) > 8:
                raise WireError(f"serial number {text!r} is not at most eight ASCII characters")
            return _encode("serial", values=list(text.encode().ljust(8, b"\0")), device_id=device_id)
        case AllegroImu(words):
            return _encode("imu", values=words, device_id=device_id)
        case AllegroStatus(data):
            return _encode("status", values=list(data), device_id=device_id)


def _encode(kind: str, finger: Finger = "index", values: Sequence[int] = (), *, device_id: int) -> CanFrame:
    if finger not in HAND_FINGERS:
        raise InvalidValueError(f"finger = {finger!r} is not one of {', '.join(HAND_FINGERS)}")
    number = HAND_FINGERS.index(finger)
    return CanFrame(*_native.allegro_encode(kind, number, list(values), device_id=device_id))


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
    return _REJECTED.get(kind) or _DECODED[kind](HAND_FINGERS[finger], values)


def allegro_requested(frame: CanFrame, *, device_id: int = 0) -> AllegroRequest | None:
    """Decode a remote frame to its request to hand `device_id`, or None: for a simulated hand."""
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
}
_REJECTED: Final = {reason: AllegroRejected(reason) for reason in get_args(Reason)}
