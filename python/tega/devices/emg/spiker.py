"""Read EMG from Backyard Brains' Muscle SpikerShield and SpikerBox: ten bits a channel, two bytes each, no counter.

The rate follows from the sketch's timer, which counts 199 steps of half a microsecond for each channel
(BackyardBrains/SpikerShield, ``Muscle/Arduino Code/SixChannels``): 10,050 samples a second for one channel, 3350 for
each of three.
"""

from __future__ import annotations

import time
from collections.abc import Mapping
from typing import Annotated, ClassVar, Final

import msgspec
import numpy as np

from tega.devices.base import Options
from tega.devices.emg.live_emg import POLL_S, Arrived
from tega.devices.emg.live_serial import BaudRate, LiveSerialEmg, LiveSerialOptions, SerialPort
from tega.errors import DeviceUnavailableError
from tega.runtime.evidence import Evidence
from tega.wire import SpikerDecoder

_STEPS_HZ: Final = 2_000_000.0
_STEPS_A_CHANNEL: Final = 199
_LARGEST: Final = 1023
# How long the board is read before it is sent the command again; some 800 frames of three channels.
_POLL_S: Final = 0.25
_ENOUGH: Final = 20  # frames that show how many channels they have


class SpikerOptions(LiveSerialOptions, frozen=True, kw_only=True):
    """Settings of :class:`Spiker`.

    Attributes:
        baud: Bits per second.
        columns: Number of channels that the board is set to send, 1 to 6; they share its converter.
    """

    baud: BaudRate = 230_400
    columns: Annotated[int, msgspec.Meta(ge=1, le=6)] = 3


class Spiker(LiveSerialEmg):
    """A board that sends as soon as it has power; the driver sets its number of channels.

    Frames carry no number and no checksum: only the rate reveals that one was lost. A frame of another length
    than agreed is refused and counted.
    """

    name: ClassVar[str] = "spiker"
    pieces: ClassVar[str] = "frames"
    summary: ClassVar[str] = "Backyard Brains Muscle SpikerShield or SpikerBox"
    options_type: ClassVar[type[Options]] = SpikerOptions
    compared: ClassVar[Mapping[Evidence, str]] = {
        "rate": "the rate of the sketch's timer is the measured one",
        "values": "frames have the channels that were asked for; no value is beyond ten bits",
    }
    _options: SpikerOptions

    def __init__(self, options: SpikerOptions) -> None:
        super().__init__(options)
        self._n_channels, self.limits = options.columns, (0.0, float(_LARGEST))
        self._rate_hz = _STEPS_HZ / (_STEPS_A_CHANNEL * options.columns)

    def _start(self) -> None:
        """Set the number of channels, and repeat until the board sends that many.

        The board ignores commands while it starts, and opening the port may restart it.
        """
        o = self._options
        port, sent = self._connect(o.baud), 0
        deadline = time.monotonic() + o.start_s
        while sent != o.columns:
            if time.monotonic() > deadline:
                sends = f"sends {sent} channels" if sent else "sends no frames of a SpikerShield"
                raise DeviceUnavailableError(
                    f"spiker: {self._label} {sends}, {o.columns} are asked for",
                    "check port, baud and the board's sketch; columns is the number of channels to ask for",
                )
            port.write(f"c:{o.columns};\n".encode())
            data = _receive(port)
            sent = _n_channels(data)
        self._decoder, self._waiting = SpikerDecoder(o.columns), data

    def _arrived(self) -> Arrived | None:
        data, arrival_ns = self._received()
        samples = self._decoder.feed(data)
        return Arrived(samples.astype(np.float64), None, arrival_ns) if len(samples) else None

    def _losses(self) -> tuple[str, ...]:
        n = self._decoder.bad_frames
        return (f"{n} frames were no row of {self._options.columns} values",) if n else ()


def _receive(port: SerialPort) -> bytes:
    """Read for a while and return the second half: the first may date from before the command."""
    data, until = b"", time.monotonic() + _POLL_S
    while time.monotonic() < until:
        data += port.read()
        time.sleep(POLL_S)
    return data[len(data) // 2 :]


def _n_channels(data: bytes) -> int:
    """Return how many channels most frames in a stretch of the stream have; 0 where there are hardly any frames."""
    starts = np.flatnonzero(np.frombuffer(data, np.uint8) & 0x80)
    lengths = np.diff(starts)
    if len(lengths) < _ENOUGH:
        return 0
    counts = np.bincount(lengths)
    most = int(counts.argmax())
    return most // 2 if most % 2 == 0 and 2 * counts[most] > len(lengths) else 0
