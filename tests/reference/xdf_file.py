"""Write what LSL inlets received as an XDF file, version 1.0, as a recorder of the Lab Streaming Layer does."""

from __future__ import annotations

import struct
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

_HEADER, _STREAM, _SAMPLES, _FOOTER = 1, 2, 3, 6


class Received(NamedTuple):
    """What came of one stream: its description in XML, and samples with their times, seconds."""

    header: str
    samples: Sequence[Sequence[float]]
    times_s: Sequence[float]


def write_xdf(path: Path, streams: Iterable[Received]) -> None:
    """Write a file of streams of doubles."""
    parts = [b"XDF:", _chunk(_HEADER, b"<?xml version='1.0'?><info><version>1.0</version></info>")]
    for number, stream in enumerate(streams, start=1):
        of = struct.pack("<I", number)
        parts.append(_chunk(_STREAM, of + stream.header.encode()))
        rows = [
            b"\x08" + struct.pack("<d", t_s) + struct.pack(f"<{len(sample)}d", *sample)
            for t_s, sample in zip(stream.times_s, stream.samples, strict=True)
        ]
        parts.append(_chunk(_SAMPLES, of + b"\x04" + struct.pack("<I", len(rows)) + b"".join(rows)))
        first, last = stream.times_s[0], stream.times_s[-1]
        ends: dict[str, Any] = {
            "first_timestamp": first,
            "last_timestamp": last,
            "sample_count": len(rows),
        }
        words = "".join(f"<{name}>{value}</{name}>" for name, value in ends.items())
        parts.append(_chunk(_FOOTER, of + f"<?xml version='1.0'?><info>{words}</info>".encode()))
    path.write_bytes(b"".join(parts))


def _chunk(tag: int, content: bytes) -> bytes:
    return b"\x04" + struct.pack("<I", len(content) + 2) + struct.pack("<H", tag) + content
