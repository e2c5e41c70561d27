"""Read EMG from an OpenBCI Cyton over its USB dongle: eight channels of calibrated microvolts at 250 Hz."""

from __future__ import annotations

from typing import ClassVar, Literal

import numpy as np

from tega.devices.base import Found, Options
from tega.devices.emg.live_emg import Arrived
from tega.devices.emg.live_serial import LiveSerialEmg, LiveSerialOptions
from tega.devices.serial_boards import find_boards
from tega.devices.serial_port import SerialPort
from tega.errors import DeviceUnavailableError

_BAUD = 115_200
_RATE_HZ = 250.0
_GAIN_DIGIT = {1: 0, 2: 1, 4: 2, 6: 3, 8: 4, 12: 5, 24: 6}
_END = b"$$$"
_ANSWER_S = 1.5
_RESET_S = 4.0


class CytonOptions(LiveSerialOptions, frozen=True, kw_only=True):
    """Settings of :class:`Cyton`.

    Attributes:
        gain: Of the channels in use; lower it where they saturate.
        bipolar: Two electrodes per channel, on its own two pins; otherwise one, against the common SRB2.
    """

    gain: Literal[1, 2, 4, 6, 8, 12, 24] = 24
    bipolar: bool = True


class Cyton(LiveSerialEmg):
    """A Cyton's channels 1 to 3, or those asked for; the others are switched off."""

    name: ClassVar[str] = "cyton"
    summary: ClassVar[str] = "OpenBCI Cyton over its USB dongle, microvolts at 250 Hz"
    options_type: ClassVar[type[Options]] = CytonOptions
    counter_turn: ClassVar[int | None] = 256
    stop_command: ClassVar[bytes] = b"s"

    def __init__(self, options: CytonOptions) -> None:
        super().__init__(options)
        self._options = options
        self._firmware = ""

    @classmethod
    def discover(cls, timeout_s: float) -> list[Found]:  # noqa: ARG003  # the system knows at once
        """List the USB serial ports with the adapter that a Cyton's dongle has; opens none.

        Raises:
            MissingExtraError: pyserial is not installed.
        """
        return find_boards(cls.name, dongles=True)

    def _start(self) -> None:
        """Silence the board, reset it, set its channels, and start the stream.

        Raises:
            DeviceUnavailableError: Nobody, or somebody else, answers, or a setting is not confirmed.
        """
        from tega.wire import CytonDecoder

        o = self._options
        port = self._connect(_BAUD)
        # A board that a crashed program left streaming answers nothing before it is told to stop.
        port.write(b"s")
        port.drain(quiet_s=0.1, timeout_s=1.0)
        self._firmware = self._reset(port)
        self._set(port, b"d", "default settings")
        for channel in range(1, 9):
            if channel in self._columns():
                digits = f"{channel}0{_GAIN_DIGIT[o.gain]}01{0 if o.bipolar else 1}0"
                self._set(port, f"x{digits}X".encode(), f"channel {channel}")
            else:
                port.write(str(channel).encode())
        self._set(port, b"~6", "250 samples/s")
        port.drain(quiet_s=0.05, timeout_s=0.5)
        self._decoder = CytonDecoder(o.gain)
        port.write(b"b")

    def _reset(self, port: SerialPort) -> str:
        """Reset the board and return its firmware's version."""
        port.write(b"v")
        said = port.read_until(_END, _RESET_S).decode("ascii", "replace")
        if not said:
            raise DeviceUnavailableError(
                f"cyton: nothing answers on {port.name}",
                "is this the dongle's port, and its switch at GPIO 6, not RESET?",
            )
        if "Failure" in said:
            raise DeviceUnavailableError(
                f"cyton: the dongle answers, the board does not: {_short(said)}",
                "switch the board on (to PC), charge its battery, or set both to one radio channel",
            )
        if "OpenBCI" not in said or _END.decode() not in said:
            raise DeviceUnavailableError(
                f"cyton: what answers on {port.name} is no Cyton: {_short(said)}", "check the port"
            )
        _, _, version = said.partition("Firmware:")
        return version.split()[0].rstrip("$") if version.split() else "unknown version"

    def _set(self, port: SerialPort, command: bytes, what: str) -> None:
        port.write(command)
        said = port.read_until(_END, _ANSWER_S).decode("ascii", "replace")
        if _END.decode() not in said or "Failure" in said:
            answer = f"answered {_short(said)}" if said else "did not answer"
            raise DeviceUnavailableError(
                f"cyton: {what} was not confirmed: the board (firmware {self._firmware}) {answer}",
                "firmware 3 or later is needed, so that the gain is certain; switch the board off and on, "
                "or update it",
            )

    def _arrived(self) -> Arrived | None:
        data, arrival_ns = self._received()
        batch = self._decoder.feed(data)
        return Arrived(batch.microvolts, batch.missing.astype(np.int64), arrival_ns) if len(batch) else None

    def _rate_hz(self) -> float:
        return _RATE_HZ

    def _all_channels(self) -> int:
        return 8

    def _columns(self) -> tuple[int, ...]:
        return self._options.channels or (1, 2, 3)

    def _unit(self) -> str:
        return "µV"

    def _limits(self) -> tuple[float, float]:
        # One count inside the scale, which is 4.5 V / gain / (2^23 - 1) a count.
        full_uv = 4.5e6 / self._options.gain * (1 - 2**-22)
        return (-full_uv, full_uv)

    def _own_notes(self) -> tuple[str, ...]:
        notes = super()._own_notes()
        if self._firmware:
            notes += (f"Cyton firmware {self._firmware}, gain {self._options.gain}",)
        if self._port is not None and (n := self._decoder.skipped_bytes):
            notes += (f"{n} bytes belonged to no packet",)
        return notes

    def _instead(self) -> str:
        if not self._n_bytes:
            return ""
        return f"since it was opened {self._n_bytes} bytes came, {self._decoder.packets} packets among them"


def _short(said: str) -> str:
    return repr(" ".join(said.split())[:80])
