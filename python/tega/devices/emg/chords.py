"""Read EMG from boards with Chords firmware (Upside Down Labs): raw converter counts in packets with a counter.

Names, rates and converters are those of the vendor's own readers (upsidedownlabs: Chords-Python
``chordspy/chords_serial.py``, Chords-Web ``src/components/boards.ts``), the way of asking fits the sketches of 2024 and
of 2026 (Chords-Arduino-Firmware).
"""

from __future__ import annotations

import itertools
import re
import time
from collections.abc import Mapping
from typing import Annotated, ClassVar

import msgspec
import numpy as np

from tega.devices.base import Options
from tega.devices.emg.live_emg import POLL_S, Arrived
from tega.devices.emg.live_serial import BaudRate, LiveSerialEmg, LiveSerialOptions, SerialPort
from tega.errors import DeviceUnavailableError
from tega.runtime.evidence import Evidence
from tega.wire import ChordsDecoder, chords_channels

# Bytes that show how many channels a packet has: at least three packets of the largest board.
_PROBE_BYTES = 256
# A board of 2026 says UNKNOWN COMMAND where it got something else.
_NAME = re.compile(rb"(?!UNKNOWN COMMAND)([!-~][ -~]*?)\s*\n")
# Speeds at which boards talk, by sketch and by converter to USB.
_BAUDS = (230_400, 115_200)
# The sketches of 2024 take what came before a second of silence for one command; those of 2026 are deaf for a second
# after a stop. So nothing more is sent before an answer had time to come.
_ANSWER_S = 1.6
_SILENCE_S = 1.2


# Rate in Hz and bits, as the vendor's readers list them; the channel count is read off the stream, since one name can
# have two. Where the two readers differ (STM32G4: 250 and 500 Hz), no rate stands here and it is measured.
_BOARDS = {
    "ESP32-S3": (250.0, 12),
    "GENUINO-UNO": (250.0, 10),
    "GIGA-R1": (500.0, 16),
    "MEGA-2560-CLONE": (250.0, 10),
    "MEGA-2560-R3": (250.0, 10),
    "NANO-CLASSIC": (250.0, 10),
    "NANO-CLONE": (250.0, 10),
    "NPG-LITE": (500.0, 12),
    "RPI-PICO-RP2040": (500.0, 12),
    "STM32F4-BLACK-PILL": (500.0, 12),
    "STM32G4-CORE-BOARD": (0.0, 12),
    "UNO-CLONE": (250.0, 10),
    "UNO-R3": (250.0, 10),
    "UNO-R4": (500.0, 14),
}


class ChordsOptions(LiveSerialOptions, frozen=True, kw_only=True):
    """Settings of :class:`Chords`.

    Attributes:
        baud: Bits per second; left out: 230400 is tried, then 115200.
        rate_hz: Samples per second, for a board that the driver does not know by name.
        bits: Resolution of the converter, for such a board.
    """

    baud: BaudRate | None = None
    rate_hz: Annotated[float, msgspec.Meta(gt=0, le=100_000)] | None = None
    bits: Annotated[int, msgspec.Meta(ge=8, le=16)] | None = None


class Chords(LiveSerialEmg):
    """A board that reports its name, starts and stops on command, and numbers its packets."""

    name: ClassVar[str] = "chords"
    summary: ClassVar[str] = "a board with Chords firmware (BioAmp, NPG Lite, UNO R4, ...)"
    options_type: ClassVar[type[Options]] = ChordsOptions
    counter_turn: ClassVar[int | None] = 256
    compared: ClassVar[Mapping[Evidence, str]] = {
        "counter": "the number of each packet follows the one before; damaged packets are left out",
        "banner": "the board's name is known, or its rate and bits are set",
        "rate": "the board's rate is the measured one",
        "values": "packets have one number of channels; no value is beyond the converter's bits",
    }
    stop_command: ClassVar[bytes] = b"STOP\n"
    _options: ChordsOptions

    def __init__(self, options: ChordsOptions) -> None:
        super().__init__(options)
        self._describe(0.0, 0)
        self._board_name = ""

    def _start(self) -> None:
        o = self._options
        self._board_name, port = self._find()
        known = _BOARDS.get(self._board_name)
        if known is None and o.rate_hz is None:
            raise DeviceUnavailableError(
                f"chords: the board says it is {self._board_name!r}, which is not known here",
                f"set rate_hz and bits in its options; known: {', '.join(_BOARDS)}",
            )
        self._describe(*known or (0.0, 0))
        port.write(b"START\n")
        data, deadline = b"", time.monotonic() + o.start_s
        while (n_channels := chords_channels(data) if len(data) >= _PROBE_BYTES else None) is None:
            if time.monotonic() > deadline:
                raise DeviceUnavailableError(
                    f"chords: {self._board_name} was started, but no packets came ({len(data)} bytes did)",
                    "check that the board runs Chords firmware",
                )
            data = (data + port.read())[-4096:]
            time.sleep(POLL_S)
        self._n_channels = n_channels
        self._decoder, self._waiting = ChordsDecoder(n_channels), data

    def _describe(self, known_hz: float, known_bits: int) -> None:
        """Take rate and range of the settings, or else of a known board."""
        self._rate_hz = self._options.rate_hz or known_hz or None
        bits = self._options.bits or known_bits
        self.limits = (0.0, float(2**bits - 1)) if bits else None

    def _find(self) -> tuple[str, SerialPort]:
        """Return the board's name and its port, open at the board's speed.

        Opening the port restarts some boards, so each speed is tried until all have been, twice at least.
        """
        o = self._options
        text, deadline = b"", time.monotonic() + o.start_s
        bauds = itertools.cycle(_BAUDS if o.baud is None else (o.baud,))
        for n, baud in enumerate(bauds):
            if n >= 2 and time.monotonic() >= deadline:
                break
            port = self._connect(baud)
            name, received = self._ask(port)
            if name:
                return name, port
            text += received
            port.close()
        tried = " and ".join(str(baud) for baud in (_BAUDS if o.baud is None else (o.baud,)))
        raise DeviceUnavailableError(
            f"chords: {self._label} did not say which board it is"
            + (f"; it said {text[:40]!r}" if text else ", and nothing came"),
            f"check the port, the baud rate (tried: {tried}), and that the board runs Chords firmware",
        )

    @staticmethod
    def _ask(port: SerialPort) -> tuple[str, bytes]:
        """Ask for the name, and again after stopping the board; return it with all received bytes."""
        answer = b""
        for again in (False, True):
            if again:
                port.write(b"STOP\n")
                port.drain(quiet_s=_SILENCE_S, timeout_s=2 * _SILENCE_S)
            port.write(b"WHORU\n")
            received = port.read_until(b"\n", _ANSWER_S)
            answer += received
            if match := _NAME.fullmatch(received):
                return match[1].decode("ascii"), answer
        return "", answer

    def _arrived(self) -> Arrived | None:
        data, arrival_ns = self._received()
        batch = self._decoder.feed(data)
        if not len(batch.samples):
            return None
        return Arrived(batch.samples.astype(np.float64), batch.missing.astype(np.int64), arrival_ns)

    def _own_notes(self) -> tuple[str, ...]:
        notes = super()._own_notes()
        if self._board_name:
            notes += (f"Chords board {self._board_name}, {self._n_channels} channels",)
        return notes
