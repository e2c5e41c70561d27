"""Decode the CAN log of an Allegro Hand into its states."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING, Final, Literal, NamedTuple

import msgspec
import numpy as np

from tega.errors import RecordingError
from tega.wire import (
    HAND_FINGERS,
    AllegroInfo,
    AllegroMessage,
    AllegroPosition,
    AllegroRejected,
    AllegroSerial,
    AllegroServo,
    AllegroTemperature,
    AllegroTorque,
    allegro_angles_rad,
    allegro_decode,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from tega.devices.hand.can_log import LoggedFrame

_HANDS: Final = range(4)


class LoggedHand(NamedTuple):
    """State of a hand when all four fingers have reported.

    Attributes:
        t_s: Seconds since the log's first frame.
        angles_rad: float64 (16,), index, middle, ring, thumb.
        torque_counts: Last pulse widths sent by a program, int64 (16,); ``None`` before all fingers had one.
        servo_on: Whether motors were switched on, by the last frame about that; ``None`` before one.
        celsius: The last joint temperatures; ``None`` where a sensor has not answered.
    """

    t_s: float
    angles_rad: NDArray[np.float64]
    torque_counts: NDArray[np.int64] | None
    servo_on: bool | None
    celsius: list[int | None]


class HandLogFacts(msgspec.Struct, kw_only=True):
    """Facts of a log, complete once it is read; versions and serial are ``""`` if the hand was not asked.

    Attributes:
        hardware: Version, such as ``4.2``.
        side: ``right``, ``left``, ``unknown`` or ``""``.
        serial: Serial number without its ``SAH040``.
        sets: Number of complete sets of joint angles.
        incomplete: Number of sets in which a finger's frame was missing.
        duration_s: From the first frame to the last.
    """

    device_id: int
    channel: str = ""
    hardware: str = ""
    firmware: str = ""
    side: str = ""
    serial: str = ""
    frames: int = 0
    sets: int = 0
    incomplete: int = 0
    duration_s: float = 0.0
    kinds: dict[str, int] = {}


class HandLog:
    """Decodes the frames of a log."""

    def __init__(self, device_id: int, channel: str) -> None:
        self.facts = HandLogFacts(device_id=device_id, channel=channel)
        self._version: Literal[4, 5] = 4
        self._counts: dict[str, tuple[int, ...]] = {}
        self._torques: dict[str, tuple[int, ...]] = {}
        self._celsius: dict[str, tuple[int | None, ...]] = {}
        self._servo_on: bool | None = None
        self._kinds: Counter[str] = Counter()

    def states(self, frames: Iterable[LoggedFrame]) -> Iterator[LoggedHand]:
        """Return a state for each complete set of joint angles."""
        facts = self.facts
        for logged in frames:
            if logged.channel != facts.channel:
                continue
            facts.frames += 1
            facts.duration_s = max(facts.duration_s, logged.t_s)
            message = _decoded(logged, facts.device_id)
            rejected = isinstance(message, AllegroRejected)
            kind = message.reason if isinstance(message, AllegroRejected) else type(message).__name__
            self._kinds[
                "fd" if logged.fd else kind if rejected else kind.removeprefix("Allegro").lower()
            ] += 1
            facts.kinds = dict(sorted(self._kinds.items()))
            if isinstance(message, AllegroPosition):
                if message.finger in self._counts:
                    facts.incomplete += 1
                    self._counts.clear()
                self._counts[message.finger] = message.counts
                if len(self._counts) == len(HAND_FINGERS):
                    yield self._state(logged.t_s)
            else:
                self._note(message)

    def _note(self, message: AllegroMessage) -> None:
        facts = self.facts
        match message:
            case AllegroTorque():
                self._torques[message.finger] = message.counts
            case AllegroTemperature():
                self._celsius[message.finger] = message.celsius
            case AllegroServo():
                self._servo_on = message.on
            case AllegroSerial():
                facts.serial = message.text
            case AllegroInfo():
                facts.hardware, facts.firmware = (
                    ".".join(map(str, v)) for v in (message.hardware, message.firmware)
                )
                facts.side, self._servo_on = message.side, message.servo_on
                self._version = 5 if message.hardware[0] == 5 else 4
            case _:
                pass

    def _state(self, t_s: float) -> LoggedHand:
        self.facts.sets += 1
        counts = [value for finger in HAND_FINGERS for value in self._counts[finger]]
        self._counts.clear()
        torques = [value for finger in HAND_FINGERS for value in self._torques.get(finger, ())]
        return LoggedHand(
            t_s,
            allegro_angles_rad(counts, version=self._version),
            np.array(torques, np.int64) if len(torques) == 16 else None,
            self._servo_on,
            [value for finger in HAND_FINGERS for value in self._celsius.get(finger, (None,) * 4)],
        )


def find_hand(
    frames: Iterable[LoggedFrame], *, device_id: int | None, channel: str | None
) -> tuple[int, str]:
    """Return number and bus of the hand in a log, the one that reports joint angles; there must be one."""
    found: Counter[tuple[int, str]] = Counter()
    n, channels = 0, set()
    for logged in frames:
        n += 1
        channels.add(logged.channel)
        if channel is not None and logged.channel != channel:
            continue
        for number in _HANDS if device_id is None else (device_id,):
            if isinstance(_decoded(logged, number), AllegroPosition):
                found[number, logged.channel] += 1
    if len(found) == 1:
        return next(iter(found))
    buses = ", ".join(sorted(one or "unnamed" for one in channels))
    if not found:
        raise RecordingError(
            f"no hand reports joint angles in its {n} frames (buses: {buses})",
            "name another --device-id or --bus",
        )
    hands = ", ".join(
        f"{number} on {bus or 'unnamed'} ({k} frames)" for (number, bus), k in sorted(found.items())
    )
    raise RecordingError(f"several hands report joint angles: {hands}", "name one with --device-id and --bus")


def _decoded(logged: LoggedFrame, device_id: int) -> AllegroMessage:
    if logged.fd:
        return AllegroRejected("unknown")
    return allegro_decode(logged.frame, device_id=device_id, extended=logged.extended, error=logged.error)
