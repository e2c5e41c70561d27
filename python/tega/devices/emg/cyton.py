"""Read EMG from an OpenBCI Cyton over its USB dongle: eight channels of calibrated microvolts at 250 Hz."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar, Literal

import numpy as np

from tega.devices.base import Found, Options
from tega.devices.emg.live_emg import Arrived
from tega.devices.emg.live_serial import LiveSerialEmg, LiveSerialOptions, SerialPort, find_boards
from tega.devices.emg.stream_evidence import AlternationCheck
from tega.errors import DeviceUnavailableError
from tega.runtime.evidence import Contradiction, Evidence, refuse
from tega.wire import CytonBatch, CytonDecoder

_BAUD = 115_200
_RATE_HZ = 250.0
_GAIN_DIGIT = {1: 0, 2: 1, 4: 2, 6: 3, 8: 4, 12: 5, 24: 6}
_END = b"$$$"
_ANSWER_S = 1.5
_RESET_S = 4.0
# A board without a Daisy may answer nothing to the command that takes the Daisy off.
_NO_DAISY_S = 0.3
_DAISY_HINT = "take the Daisy off the board, or update the firmware; its channels 9 to 16 are not read"


class CytonOptions(LiveSerialOptions, frozen=True, kw_only=True):
    """Settings of :class:`Cyton`.

    Attributes:
        gain: Gain of the channels in use; lower it if they saturate.
        bipolar: Two electrodes per channel, on its own two pins; otherwise one, against the common SRB2.
    """

    gain: Literal[1, 2, 4, 6, 8, 12, 24] = 24
    bipolar: bool = True


class Cyton(LiveSerialEmg):
    """A Cyton's channels 1 to 3, or those asked for; the others are switched off."""

    name: ClassVar[str] = "cyton"
    unit: ClassVar[str] = "µV"
    usual_channels: ClassVar[tuple[int, ...]] = (1, 2, 3)
    likelihood: ClassVar[int] = 1
    summary: ClassVar[str] = "OpenBCI Cyton over its USB dongle, microvolts at 250 Hz"
    options_type: ClassVar[type[Options]] = CytonOptions
    counter_turn: ClassVar[int | None] = 256
    counter_hint: ClassVar[str] = (
        "update the radio firmware of board and dongle to one version: their packets are shifted against each other"
    )
    stop_command: ClassVar[bytes] = b"s"
    compared: ClassVar[Mapping[Evidence, str]] = {
        "counter": "the number of each packet follows the one before; damaged packets are left out",
        "banner": "an OpenBCI board with firmware 3; a Daisy is switched off, or refused",
        "rate": "the board confirms 250 Hz, and sends it",
        "values": "packets of even and odd number show the same electrodes; unused channels stay off",
    }
    _options: CytonOptions

    def __init__(self, options: CytonOptions) -> None:
        super().__init__(options)
        self._rate_hz, self._n_channels = _RATE_HZ, 8
        # One count inside the scale, which is 4.5 V / gain / (2^23 - 1) a count.
        full_uv = 4.5e6 / options.gain * (1 - 2**-22)
        self.limits = (-full_uv, full_uv)
        self._firmware, self._has_daisy = "", False

    @classmethod
    def discover(cls, timeout_s: float) -> list[Found]:  # noqa: ARG003  # the system knows at once
        """List the USB serial ports with the adapter that a Cyton's dongle has; opens none."""
        return find_boards(cls.name, dongles=True)

    def _start(self) -> None:
        o = self._options
        port = self._connect(_BAUD)
        # A board that a crashed program left streaming answers nothing before it is stopped.
        port.write(b"s")
        port.drain(quiet_s=0.1, timeout_s=1.0)
        self._firmware = self._reset(port)
        self._set(port, b"d", "default settings")
        self._take_daisy_off(port)
        for channel in range(1, 9):
            if channel in self._columns():
                digits = f"{channel}0{_GAIN_DIGIT[o.gain]}01{0 if o.bipolar else 1}0"
                self._set(port, f"x{digits}X".encode(), f"channel {channel}")
            else:
                port.write(str(channel).encode())
        confirmed = self._set(port, b"~6", "250 samples/s")
        if "Sample rate is " in confirmed and "250Hz" not in confirmed.replace(" ", ""):
            found = f"the board answers {_short(confirmed)} where 250 Hz was set"
            refuse(self.name, self._label, Contradiction("rate", found, "update the board's firmware"))
        port.drain(quiet_s=0.05, timeout_s=0.5)
        self._decoder = CytonDecoder(o.gain)
        self._check = AlternationCheck(self._columns(), step_uv=4.5e6 / o.gain * 2**-23)
        port.write(b"b")

    def _reset(self, port: SerialPort) -> str:
        port.write(b"v")
        text = port.read_until(_END, _RESET_S).decode("ascii", "replace")
        if not text:
            raise DeviceUnavailableError(
                f"cyton: nothing answers on {port.name}",
                "is this the dongle's port, and its switch at GPIO 6, not RESET?",
            )
        if "Failure" in text:
            raise DeviceUnavailableError(
                f"cyton: the dongle answers, the board does not: {_short(text)}",
                "switch the board on (to PC), charge its battery, or set both to one radio channel",
            )
        if "OpenBCI" not in text or _END.decode() not in text:
            raise DeviceUnavailableError(
                f"cyton: what answers on {port.name} is no Cyton: {_short(text)}", "check the port"
            )
        self._has_daisy = "daisy" in text.lower()
        _, _, version = text.partition("Firmware:")
        return version.split()[0].rstrip("$") if version.split() else "unknown version"

    def _take_daisy_off(self, port: SerialPort) -> None:
        """Take the second eight channels off, which otherwise replace the first eight in every second packet."""
        port.write(b"c")
        text = port.read_until(_END, _ANSWER_S if self._has_daisy else _NO_DAISY_S).decode("ascii", "replace")
        if self._has_daisy and ("removed" not in text.lower() or "Failure" in text):
            answer = f"answers {_short(text)}" if text else "does not answer"
            found = f"a Daisy is attached, and the board {answer} to the command that takes it off"
            refuse(self.name, self._label, Contradiction("banner", found, _DAISY_HINT))

    def _set(self, port: SerialPort, command: bytes, subject: str) -> str:
        port.write(command)
        text = port.read_until(_END, _ANSWER_S).decode("ascii", "replace")
        if _END.decode() not in text or "Failure" in text:
            answer = f"answered {_short(text)}" if text else "did not answer"
            raise DeviceUnavailableError(
                f"cyton: {subject} was not confirmed: the board (firmware {self._firmware}) {answer}",
                "firmware 3 or later is needed, so that the gain is certain; switch the board off and on, "
                "or update it",
            )
        return text

    def _arrived(self) -> Arrived | None:
        data, arrival_ns = self._received()
        batch: CytonBatch = self._decoder.feed(data)
        self._check.take(batch.counters, batch.microvolts)
        if (found := self._check.found) and self._order.contradiction is None:
            refuse(self.name, self._label, Contradiction("values", found, _DAISY_HINT))
        return Arrived(batch.microvolts, batch.missing.astype(np.int64), arrival_ns) if len(batch) else None

    def _undecided(self) -> bool:
        return not self._check.is_decided

    def _own_notes(self) -> tuple[str, ...]:
        notes = super()._own_notes()
        if self._firmware:
            daisy = ", its Daisy switched off" if self._has_daisy else ""
            notes += (f"Cyton firmware {self._firmware}, gain {self._options.gain}{daisy}",)
        return notes


def _short(text: str) -> str:
    return repr(" ".join(text.split())[:80])
