"""Find a text file's encoding from its bytes, and read its lines a block at a time."""

from __future__ import annotations

import codecs
import contextlib
import gzip
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import IO, NamedTuple

from tega.errors import RecordingError
from tega.runtime.files.foreign_file import MIB

MOST_MIB = 4096
"""An hour of 16 channels at 4 kHz as text has half of it."""

_BLOCK_BYTES = 2 * MIB
# No table's line is longer: an hour of one channel at 4 kHz, sideways, has 150 MB.
_MOST_LINE = 256 * MIB
_BOMS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
# Of a text in Latin-1 at most this share of the bytes is beyond ASCII: a µ in the names, an umlaut in a comment.
_MOST_FOREIGN = 0.1
_ASCII = bytes(range(0x80))
# Signs of Windows-1252, where Latin-1 has none.
_WINDOWS = bytes(range(0x80, 0xA0))


class Encoding(NamedTuple):
    """Encoding of a text file, by Python's name; ``mark`` is the length of its byte order mark in bytes."""

    name: str
    mark: int = 0

    @property
    def displayed(self) -> str:
        """The name as people know it."""
        return {"latin-1": "Latin-1", "cp1252": "Windows-1252"}.get(
            self.name, self.name.upper().removesuffix("-LE")
        )


class Lines(NamedTuple):
    """Consecutive lines of a file, without their ends."""

    first: int
    lines: list[str]


def find_encoding(head: bytes, name: str) -> Encoding:
    """Return the encoding of a text by its first bytes; ``RecordingError`` where it is no text."""
    for mark, encoding in _BOMS:
        if head.startswith(mark):
            return Encoding(encoding, len(mark))
    if (zeros := head.count(0)) > 0:
        odd, even = head[1::2].count(0), head[::2].count(0)
        if odd > len(head) // 4 and even < odd // 8:
            return Encoding("utf-16-le")
        if even > len(head) // 4 and odd < even // 8:
            return Encoding("utf-16-be")
        raise RecordingError(
            f"{name}: not text: byte {head.index(0)} is 0x00 ({zeros} of the first {len(head)})",
            "give a table of numbers as text, or one of the formats that emg inspect lists",
        )
    try:
        codecs.getincrementaldecoder("utf-8")().decode(head)
    except UnicodeDecodeError as error:
        foreign = len(head.translate(None, _ASCII))
        if foreign > max(1, _MOST_FOREIGN * len(head)):
            raise RecordingError(
                f"{name}: not text: byte {error.start} is {head[error.start]:#04x}",
                "give a table of numbers as text, or one of the formats that emg inspect lists",
            ) from error
        windows = len(head.translate(None, _WINDOWS)) < len(head)
        return Encoding("cp1252" if windows else "latin-1")
    return Encoding("utf-8")


@contextlib.contextmanager
def opened(path: Path) -> Iterator[IO[bytes]]:
    """Open a file for reading, through gzip if compressed; refused above :data:`MOST_MIB` when inflated."""
    with path.open("rb") as raw:
        packed = raw.read(2) == b"\x1f\x8b"
        raw.seek(0)
        try:
            if packed:
                with gzip.GzipFile(fileobj=raw) as file:
                    yield file  # type: ignore[misc]
            else:
                yield raw
        except (EOFError, zlib.error, gzip.BadGzipFile) as error:
            raise RecordingError(f"{path.name}: a damaged gzip file: {error}", "copy it again") from error


def head_of(path: Path, n_bytes: int) -> bytes:
    """Return a file's first bytes, inflated if it is compressed."""
    with opened(path) as file:
        return file.read(n_bytes)


def read_lines(path: Path, encoding: Encoding) -> Iterator[Lines]:
    """Yield a file's lines, about a block of 2 MiB at a time; lines end with LF, CR LF or CR.

    Another encoding, a line that never ends and a file larger than is read are each ``RecordingError``.
    """
    decoder = codecs.getincrementaldecoder(encoding.name)()
    rest, number, n_read = "", 1, encoding.mark
    returns = None
    with opened(path) as file:
        file.read(encoding.mark)
        while True:
            data = file.read(_BLOCK_BYTES)
            try:
                text = decoder.decode(data, final=not data)
            except UnicodeDecodeError as error:
                at = n_read + error.start
                raise RecordingError(
                    f"{path.name}: not {encoding.name} text from byte {at} on", "save it again as UTF-8"
                ) from error
            n_read += len(data)
            if n_read > MOST_MIB * MIB:
                raise RecordingError(f"{path.name}: more than {MOST_MIB} MiB of text", "cut the recording")
            if returns is None:
                returns = "\r" in text and "\n" not in text
            if returns:
                text = text.replace("\r", "\n")
            lines = (rest + text).split("\n")
            rest = lines.pop() if data else ""
            if len(rest) > _MOST_LINE:
                raise RecordingError(f"{path.name}:{number}: a line of more than 256 MiB", "is it a table?")
            if lines:
                yield Lines(number, [line.rstrip("\r") for line in lines] if "\r" in text else lines)
            number += len(lines)
            if not data:
                return
