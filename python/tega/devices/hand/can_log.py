"""Read the CAN logs of other programs with python-can's own readers, and decode those of an Allegro Hand."""

from __future__ import annotations

import logging
import subprocess
import tempfile
from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import IO, Any, Final, Literal, NamedTuple

import msgspec
import numpy as np
from numpy.typing import NDArray

from tega.errors import MissingExtraError, RecordingError
from tega.runtime.child_process import python_command, python_environment
from tega.runtime.files.foreign_file import check_file
from tega.runtime.lifecycle import require
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
    CanFrame,
    allegro_angles_rad,
    allegro_decode,
)

_READERS: Final = {".asc": "ASCReader", ".blf": "BLFReader", ".log": "CanutilsLogReader", ".trc": "TRCReader"}
LOG_SUFFIXES: Final = (*_READERS, ".mf4")
_MOST_MIB: Final = 16 * 1024
_PATIENCE_S: Final = 300
_NO_PACKAGE: Final = 3
# A frame that is no classic one, or whose numbers a damaged log has made up.
_MOST_ID, _MOST_BYTES = 1 << 29, 64


class LoggedFrame(NamedTuple):
    """A frame of a log, classic or CAN FD (``fd``), with up to 64 bytes.

    ``t_s`` counts from the log's first frame. ``extended``: the identifier has 29 bits. ``error``: an error
    frame of the controller. ``channel`` is name or number of the bus in the log.
    """

    t_s: float
    frame: CanFrame
    extended: bool
    error: bool
    fd: bool
    channel: str


def read_can_log(path: Path) -> Iterator[LoggedFrame]:
    """Return the frames of a log in their order.

    The log is of Vector (``.asc``, ``.blf``), can-utils (``.log``), PEAK (``.trc``) or ASAM (``.mf4``, which
    needs asammdf). ``RecordingError``: it is missing, of another format, empty or damaged.
    """
    if path.suffix.lower() not in LOG_SUFFIXES:
        raise RecordingError(
            f"{path.name}: no CAN log that is read", f"its name has to end in {', '.join(LOG_SUFFIXES)}"
        )
    can: Any = require("can", driver="hand decode", extra="lab")
    try:
        check_file(path, most_mib=_MOST_MIB)
    except OSError as error:
        raise RecordingError(
            f"{path.name}: cannot be read: {error.strerror}", f"looked for {path}"
        ) from error
    n, first_s = 0, 0.0
    try:
        with _messages(can, path) as messages:
            for message in messages:
                first_s = message.timestamp if n == 0 else first_s
                yield _logged(message, message.timestamp - first_s)
                n += 1
    except NotImplementedError as error:
        raise MissingExtraError(
            f"{path.name}: needs the package 'asammdf', which cannot be imported ({error})",
            "pip install asammdf",
        ) from error
    except GeneratorExit:
        raise
    except Exception as error:  # of a damaged log the readers raise what they like
        text = f"damaged after {n} frames: {type(error).__name__}: {' '.join(str(error).split())[:200]}"
        raise RecordingError(f"{path.name}: {text}", "record it again, or cut it there") from error
    if not n:
        raise RecordingError(f"{path.name}: holds no CAN frame", "is it the right file?")


@contextmanager
def _messages(can: Any, path: Path) -> Iterator[Any]:
    """Open a log with python-can's reader, which does not print the lines that it does not know."""
    suffix, log = path.suffix.lower(), logging.getLogger("can")
    level = log.level
    log.setLevel(logging.CRITICAL + 1)
    try:
        if suffix == ".mf4":
            with _converted(path) as file:
                yield can.CanutilsLogReader(file)
        else:  # a reader that refuses a file leaves one open that it has opened itself
            with (
                path.open("rb") if suffix == ".blf" else path.open(encoding="utf-8", errors="replace") as file
            ):
                yield getattr(can, _READERS[suffix])(file)
    finally:
        log.setLevel(level)


@contextmanager
def _converted(path: Path) -> Iterator[IO[str]]:
    """Return an ``.mf4`` log in can-utils' format, converted by :mod:`tega.devices.hand.mf4_program`."""
    with tempfile.TemporaryFile("w+", encoding="utf-8") as file:
        try:
            done = subprocess.run(
                python_command("tega.devices.hand.mf4_program", str(path.resolve())),
                stdin=subprocess.DEVNULL,
                stdout=file,
                stderr=subprocess.PIPE,
                env=python_environment(),
                timeout=_PATIENCE_S,
                check=False,
            )
        except subprocess.TimeoutExpired:
            raise ValueError(f"not read within {_PATIENCE_S} s") from None
        if done.returncode == _NO_PACKAGE:
            raise NotImplementedError("asammdf")
        if done.returncode:
            lines = done.stderr.decode(errors="replace").strip().splitlines()
            raise ValueError(lines[-1][:200] if lines else "asammdf gave up")
        file.seek(0)
        yield file


def _logged(message: Any, t_s: float) -> LoggedFrame:
    can_id, data = int(message.arbitration_id), bytes(message.data or b"")
    if not 0 <= can_id < _MOST_ID or len(data) > _MOST_BYTES or not -1e12 < t_s < 1e12:
        raise ValueError(f"a frame {can_id:#x} of {len(data)} bytes at {t_s:g} s")
    channel = "" if message.channel is None else str(message.channel)
    return LoggedFrame(
        t_s,
        CanFrame(can_id, data, bool(message.is_remote_frame)),
        bool(message.is_extended_id),
        bool(message.is_error_frame),
        bool(message.is_fd),
        channel,
    )


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
            kind = type(message).__name__.removeprefix("Allegro").lower()
            if isinstance(message, AllegroRejected):
                kind = "fd" if logged.fd else message.reason
            self._kinds[kind] += 1
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
                facts.hardware = ".".join(map(str, message.hardware))
                facts.firmware = ".".join(map(str, message.firmware))
                facts.side, self._servo_on = message.side, message.servo_on
                self._version = 5 if message.hardware[0] == 5 else 4

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
