"""Read EMG from any board that prints its samples as numbers, one sample a line: Arduino and its kind."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, ClassVar

import msgspec

from tega.devices.base import Found, Options
from tega.devices.emg.live_emg import Arrived
from tega.devices.emg.live_serial import BaudRate, LiveSerialEmg, LiveSerialOptions, find_boards
from tega.runtime.evidence import Evidence
from tega.wire import AsciiEmgDecoder


class SerialEmgOptions(LiveSerialOptions, frozen=True, kw_only=True):
    """Settings of :class:`SerialEmg`.

    Attributes:
        rate_hz: Lines per second the board is programmed to print; proven when the source opens.
        baud: Bits per second.
        columns: Samples on a line, one per channel.
        leading: Fields before them, such as a time stamp, that are dropped.
        bits: Resolution of the board's converter, for saturation detection; ``None`` disables it.
    """

    rate_hz: Annotated[float, msgspec.Meta(gt=0, le=100_000)]
    baud: BaudRate = 115_200
    columns: Annotated[int, msgspec.Meta(ge=1, le=64)] = 3
    leading: Annotated[int, msgspec.Meta(ge=0, le=64)] = 0
    bits: Annotated[int, msgspec.Meta(ge=8, le=24)] | None = None


class SerialEmg(LiveSerialEmg):
    """Lines of numbers from a serial port, without counters: only the rate reveals that a line was lost."""

    name: ClassVar[str] = "serial-emg"
    unit: ClassVar[str] = "as sent"
    unseen: ClassVar[str] = "there is no USB serial port"
    summary: ClassVar[str] = "a board that prints samples as lines of numbers (Arduino, MyoWare, ...)"
    options_type: ClassVar[type[Options]] = SerialEmgOptions
    free_columns: ClassVar[bool] = True
    compared: ClassVar[Mapping[Evidence, str]] = {
        "rate": "lines per second are those of rate_hz",
        "values": "each line has the fields that are set; no column is a counter or a time stamp; bits hold",
    }
    _options: SerialEmgOptions

    def __init__(self, options: SerialEmgOptions) -> None:
        super().__init__(options)
        self._rate_hz, self._n_channels, self._n_rows = options.rate_hz, options.columns, 0
        self.limits = None if options.bits is None else (0.0, float(2**options.bits - 1))

    @classmethod
    def discover(cls, timeout_s: float) -> list[Found]:  # noqa: ARG003  # the system knows at once
        """List the USB serial ports that may have a board behind them; opens none."""
        return find_boards(cls.name, dongles=False)

    def _start(self) -> None:
        o = self._options
        self._connect(o.baud)
        self._n_rows = 0
        self._decoder = AsciiEmgDecoder(o.columns, leading=o.leading)

    def _arrived(self) -> Arrived | None:
        data, arrival_ns = self._received()
        samples = self._decoder.feed(data)
        self._n_rows += len(samples)
        return Arrived(samples, None, arrival_ns) if len(samples) else None

    def _losses(self) -> tuple[str, ...]:
        n = self._decoder.rejected_lines
        subject = f"lines were no row of {self._options.columns} numbers"
        return (f"{n} {subject}, the last one {self._text()}",) if n else ()

    def _instead(self) -> str:
        if not self._n_bytes:
            return ""
        if not self._decoder.rejected_lines:
            return "" if self._n_rows else f"{self._n_bytes} bytes came without a whole line among them"
        fields = self._options.columns + self._options.leading
        return f"a line of {fields} numbers was expected, the last one was {self._text()}"

    def _text(self) -> str:
        line = self._decoder.last_rejected[:40].decode("ascii", "replace").strip()
        return repr(line) if line.isascii() and line.isprintable() else "no text: is baud the board's own?"
