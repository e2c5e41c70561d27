"""Boards with Chords firmware (Upside Down Labs): raw converter counts in packets with a counter."""

from __future__ import annotations

import time
from typing import Annotated, ClassVar, NamedTuple

import msgspec
import numpy as np

from tega.devices.base import Options
from tega.devices.live_emg import Arrived
from tega.devices.live_serial import BaudRate, LiveSerialEmg, LiveSerialOptions
from tega.devices.serial_port import POLL_S, SerialPort
from tega.errors import DeviceUnavailableError

__all__ = ["Chords", "ChordsOptions"]

# Bytes that show how many channels a packet has: at least three packets of the largest board.
_LOOK_BYTES = 256
_ASK_EVERY_S = 0.5


class _Board(NamedTuple):
    rate_hz: float
    bits: int


# As the firmware's own reader lists them; the channel count is read off the stream, since one name can have two.
_BOARDS = {
    "UNO-R3": _Board(250.0, 10),
    "UNO-R4": _Board(500.0, 14),
    "RPI-PICO-RP2040": _Board(500.0, 12),
    "NPG-LITE": _Board(500.0, 12),
    "GIGA-R1": _Board(500.0, 16),
    "MEGA": _Board(250.0, 10),
}


class ChordsOptions(LiveSerialOptions, frozen=True, kw_only=True):
    """Settings of :class:`Chords`.

    Attributes:
        baud: Bits per second: 230400 or 115200, by board.
        rate_hz: Samples per second, for a board whose name is not known here.
        bits: Of its converter, likewise.
    """

    baud: BaudRate = 230_400
    rate_hz: Annotated[float, msgspec.Meta(gt=0, le=100_000)] | None = None
    bits: Annotated[int, msgspec.Meta(ge=8, le=16)] | None = None


class Chords(LiveSerialEmg):
    """A board that says its name, starts and stops on command, and numbers its packets.

    Args:
        options: The settings.
    """

    name: ClassVar[str] = "chords"
    summary: ClassVar[str] = "a board with Chords firmware (BioAmp, NPG Lite, UNO R4, ...)"
    options_type: ClassVar[type[Options]] = ChordsOptions
    counter_turn: ClassVar[int | None] = 256
    stop_command: ClassVar[bytes] = b"STOP\n"

    def __init__(self, options: ChordsOptions) -> None:
        super().__init__(options)
        self._options = options
        self._board = _Board(options.rate_hz or 0.0, options.bits or 0)
        self._board_name = ""
        self._n_channels = 0
        self._waiting = b""

    def _start(self) -> None:
        """Ask the board who it is, start it, and read off the stream how many channels it sends.

        Raises:
            DeviceUnavailableError: It does not answer, is not known, or sends no packet.
        """
        from tega.wire import ChordsDecoder, chords_channels

        o = self._options
        port = self._connect(o.baud)
        self._board_name = self._ask(port)
        known = _BOARDS.get(self._board_name)
        if known is None and o.rate_hz is None:
            raise DeviceUnavailableError(
                f"chords: the board says it is {self._board_name!r}, which is not known here",
                f"set rate_hz and bits in its options; known: {', '.join(_BOARDS)}",
            )
        self._board = _Board(
            o.rate_hz or (known.rate_hz if known else 0.0), o.bits or (known.bits if known else 0)
        )
        port.write(b"START\n")
        data, deadline = b"", time.monotonic() + o.start_s
        while (n_channels := chords_channels(data) if len(data) >= _LOOK_BYTES else None) is None:
            if time.monotonic() > deadline:
                raise DeviceUnavailableError(
                    f"chords: {self._board_name} was started, but no packets came ({len(data)} bytes did)",
                    "check the baud rate (230400 or 115200) and that the board runs Chords firmware",
                )
            data = (data + port.read())[-4096:]
            time.sleep(POLL_S)
        self._n_channels = n_channels
        self._decoder, self._waiting = ChordsDecoder(n_channels), data

    def _ask(self, port: SerialPort) -> str:
        """Return the board's name; opening the port restarts some boards, so ask until they have started."""
        deadline, said = time.monotonic() + self._options.start_s, b""
        while time.monotonic() < deadline:
            port.write(b"STOP\n")
            port.drain(quiet_s=0.1, timeout_s=1.0)
            port.write(b"WHORU\n")
            said = port.read_until(b"\n", _ASK_EVERY_S)
            name = said.strip().decode("ascii", "replace")
            if said.endswith(b"\n") and name and name.isprintable():
                return name
        raise DeviceUnavailableError(
            f"chords: {port.name} did not say which board it is"
            + (f"; it said {said[:40]!r}" if said else ", and nothing came"),
            "check the port, the baud rate, and that the board runs Chords firmware",
        )

    def _arrived(self) -> Arrived | None:
        data, arrival_ns = self._received()
        batch = self._decoder.feed(self._waiting + data)
        self._waiting = b""
        if not len(batch.samples):
            return None
        return Arrived(batch.samples.astype(np.float64), batch.missing.astype(np.int64), arrival_ns)

    def _rate_hz(self) -> float | None:
        return self._board.rate_hz or None

    def _all_channels(self) -> int:
        return self._n_channels

    def _unit(self) -> str:
        return "counts"

    def _limits(self) -> tuple[float, float] | None:
        return (0.0, float(2**self._board.bits - 1)) if self._board.bits else None

    def _own_notes(self) -> tuple[str, ...]:
        notes = super()._own_notes()
        if self._board_name:
            notes += (f"Chords board {self._board_name}, {self._n_channels} channels",)
        if self._port is not None and self._n_channels and (n := self._decoder.skipped_bytes):
            notes += (f"{n} bytes belonged to no packet",)
        return notes

    def _instead(self) -> str:
        if not self._n_bytes:
            return ""
        return f"since it was opened {self._n_bytes} bytes came, {self._decoder.packets} packets among them"
