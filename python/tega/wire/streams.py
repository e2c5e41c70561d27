"""Decode the muscle sensors' serial streams.

Feed each decoder with bytes as they arrive, in chunks of any size; it returns the packets that they complete. None of
them keeps more than a few packets' worth of bytes, and none raises for any input from a port; what is no buffer of
bytes is a ``DtypeError``. A decoder belongs to one thread at a time.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega import _native
from tega.wire.arrays import as_bytes


@dataclass(frozen=True, slots=True)
class CytonBatch:
    """Packets of an OpenBCI Cyton, oldest first.

    Attributes:
        counters: (n,) uint8, the board's counter.
        missing: (n,) uint8, packets missing before each, by the counter, modulo 256: a loss of exactly 256 is
            invisible, so compare with the elapsed time as well.
        counts: (n, 8) int32.
        microvolts: (n, 8) float64, µV.
        acceleration_g: (n, 3) float64, g; NaN where a packet has no new reading.
        time_ms: (n,) int64, the board's clock in ms; -1 where a packet does not hold it.
        aux: (n, 6) uint8, the auxiliary bytes as sent.
        footers: (n,) uint8, 0xC0 to 0xC6.
    """

    counters: NDArray[np.uint8]
    missing: NDArray[np.uint8]
    counts: NDArray[np.int32]
    microvolts: NDArray[np.float64]
    acceleration_g: NDArray[np.float64]
    time_ms: NDArray[np.int64]
    aux: NDArray[np.uint8]
    footers: NDArray[np.uint8]

    def __len__(self) -> int:
        """Return the number of packets."""
        return len(self.counters)


class _Framed:
    """Counters of the bytes of a stream of packets or frames."""

    _stream: _native.CytonStream | _native.ChordsStream | _native.SpikerStream

    @property
    def skipped_bytes(self) -> int:
        """Bytes so far that belong to no packet or frame given."""
        return self._stream.stats()[2]

    @property
    def pending_bytes(self) -> int:
        """Bytes held back until more arrive."""
        return self._stream.stats()[3]


class _NumberedPackets(_Framed):
    """Counters of a stream of numbered packets."""

    @property
    def packets(self) -> int:
        """Packets given so far."""
        return self._stream.stats()[0]

    @property
    def missing_packets(self) -> int:
        """Packets missing so far, by the counter."""
        return self._stream.stats()[1]


class CytonDecoder(_NumberedPackets):
    r"""Finds packets in the stream of an OpenBCI Cyton, whatever else it holds.

    A packet that follows another with the next counter is returned at once; so is one that holds no second header.
    Otherwise the decoder waits for up to three more packets, and their counters decide, so that a payload full of
    headers cannot capture the decoder. Packets that cannot be distinguished from false ones are dropped. At most 130
    bytes are held back.

    ``gain`` of all channels is 1, 2, 4, 6, 8, 12 or 24, else ``InvalidValueError``. The board does not report it.

    Example:
        >>> decoder = CytonDecoder()
        >>> packet = bytes([0xA0, 7, 0, 0, 1]) + bytes(27) + b"\xc0"
        >>> len(decoder.feed(packet[:10]))
        0
        >>> decoder.feed(packet[10:]).counters.tolist()
        [7]
    """

    def __init__(self, gain: int = 24) -> None:
        self._stream = _native.CytonStream(gain=gain)

    def feed(self, data: bytes | bytearray | memoryview) -> CytonBatch:
        """Take the next bytes and give the packets they complete."""
        return CytonBatch(*self._stream.feed(as_bytes(data)))


class ChordsBatch(NamedTuple):
    """Packets of a board with Chords firmware, oldest first.

    Attributes:
        counters: (n,) uint8, the board's counter; only its differences mean anything.
        missing: (n,) uint8, packets missing before each, by the counter, modulo 256.
        samples: (n, channels) uint16, converter counts around mid-range.
    """

    counters: NDArray[np.uint8]
    missing: NDArray[np.uint8]
    samples: NDArray[np.uint16]


class ChordsDecoder(_NumberedPackets):
    """Finds packets in the stream of a board with Chords firmware, by the rules of :class:`CytonDecoder`.

    ``channels`` is 1 to 16; :func:`chords_channels` reads it off a stream; ``InvalidValueError`` for another.

    Example:
        >>> ChordsDecoder(3).feed(bytes.fromhex("C77C 01 0200 0800 0FFF 01")).samples.tolist()
        [[512, 2048, 4095]]
    """

    def __init__(self, channels: int = 3) -> None:
        self._stream = _native.ChordsStream(channels=channels)

    def feed(self, data: bytes | bytearray | memoryview) -> ChordsBatch:
        """Take the next bytes and give the packets they complete."""
        return ChordsBatch(*self._stream.feed(as_bytes(data)))


def chords_channels(data: bytes | bytearray | memoryview) -> int | None:
    """Return the number of channels of the packets in a stretch of a Chords stream, or None.

    The result is the number that gives most packets in unbroken order, at least three; only the first 4096 bytes are
    examined. A board's name does not always determine it: boards of one name exist with three channels and with six.
    """
    return _native.chords_channels(as_bytes(data))


class SpikerDecoder(_Framed):
    """Finds frames in the stream of a SpikerShield, which has neither counter nor checksum.

    A frame is given when the next one begins, since a loss shows only as a frame of the wrong length.

    ``channels`` is 1 to 6; ``InvalidValueError`` for another.

    Example:
        >>> SpikerDecoder(3).feed(bytes.fromhex("877F 0000 0400 80")).tolist()
        [[1023, 0, 512]]
    """

    _stream: _native.SpikerStream

    def __init__(self, channels: int = 3) -> None:
        self._stream = _native.SpikerStream(channels=channels)

    def feed(self, data: bytes | bytearray | memoryview) -> NDArray[np.uint16]:
        """Take the next bytes and give the frames they complete: (n, channels) uint16, 0 to 1023."""
        return self._stream.feed(as_bytes(data))

    @property
    def frames(self) -> int:
        """Frames given so far."""
        return self._stream.stats()[0]

    @property
    def bad_frames(self) -> int:
        """Frames refused so far: too short, too long, or with a value above 1023."""
        return self._stream.stats()[1]


class AsciiEmgDecoder:
    r"""Finds samples in lines of decimal numbers, one sample a line, as Arduino sketches print them.

    Fields are separated by ``,`` or ``;``, with blanks or tabs around them or alone; one separator may trail.
    A field is a decimal number, with a point and an exponent if it likes, or ``name:number``. Any other line,
    one with another number of fields, and one of more than 256 bytes are refused and counted.

    Args:
        channels: Fields that are samples, 1 to 64.
        leading: Fields before them, such as a time stamp, that are read and dropped.
        drop_first_line: Drop everything before the first line break, since a port is rarely opened between
            two lines. False for a file, which begins with a whole line.

    Raises:
        InvalidValueError: If there are more or fewer channels, or more than 64 leading fields.

    Example:
        >>> decoder = AsciiEmgDecoder(channels=3)
        >>> decoder.feed(b"12\r\n510,511,512\r\nMyoWare\r\n1,2,").tolist()
        [[510.0, 511.0, 512.0]]
        >>> decoder.rejected_lines, decoder.last_rejected
        (1, b'MyoWare\r')
    """

    def __init__(self, channels: int = 3, *, leading: int = 0, drop_first_line: bool = True) -> None:
        self._stream = _native.AsciiStream(channels=channels, leading=leading, drop_first=drop_first_line)

    def feed(self, data: bytes | bytearray | memoryview) -> NDArray[np.float64]:
        """Take the next bytes and give the samples they complete: (n, channels) float64."""
        return self._stream.feed(as_bytes(data))

    @property
    def lines(self) -> int:
        """Lines accepted so far."""
        return self._stream.stats()[0]

    @property
    def rejected_lines(self) -> int:
        """Lines refused so far."""
        return self._stream.stats()[1]

    @property
    def dropped_bytes(self) -> int:
        """Bytes dropped before the first line break."""
        return self._stream.stats()[2]

    @property
    def pending_bytes(self) -> int:
        """Bytes of the line in progress, at most 256."""
        return self._stream.stats()[3]

    @property
    def last_rejected(self) -> bytes:
        """The line refused last, at most 256 bytes of it: often a banner or an error text of the board."""
        return self._stream.last_rejected()
