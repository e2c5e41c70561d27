"""What is missing in a recording: at its end, and on the way."""

from __future__ import annotations

from pathlib import Path

import msgspec

from tega.recording.mcap_reader import McapReader

__all__ = ["Kept", "look"]

# Ticks come 30 times a second.
LEAST_GAP_S = 0.2
# Each of the loop's vest ticks leaves one of these, so that a gap in them is a gap in the recording.
_TICKS = frozenset({"/vest/frame", "/run/skipped"})
_RATES_HZ = {"image": 60.0, "frames": 333.0, "bus": 333.0, "samples": 60.0}


class Kept(msgspec.Struct, frozen=True):
    """What a recording holds.

    Attributes:
        file: Its name.
        newest_ns: Time of day of the newest record of the loop.
        gaps: Times of day, ns, from one such record to the next where that is longer than ``LEAST_GAP_S``.
        dropped_s: The records that did not fit, of the stream that lost most, in seconds of it.
        cut: Why reading ended early, ``""`` where it did not.
    """

    file: str
    newest_ns: int
    gaps: list[tuple[int, int]]
    dropped_s: float
    cut: str


def look(path: Path) -> Kept:
    """Read a recording from its beginning to its end.

    Raises:
        RecordingError: It cannot be read.
    """
    reader = McapReader(path)
    newest_ns = last_ns = 0
    gaps: list[tuple[int, int]] = []
    dropped: dict[str, int] = {}
    wanted = _TICKS | {"/recorder/status"}
    for message in reader.messages(lambda topic: topic in wanted):
        if message.topic == "/recorder/status":
            dropped = dict(zip(message.value.dropped_topics, message.value.dropped_counts, strict=True))
            continue
        newest_ns = max(newest_ns, message.log_ns)
        if last_ns and message.log_ns - last_ns > LEAST_GAP_S * 1e9:
            gaps.append((last_ns, message.log_ns))
        last_ns = message.log_ns
    dropped |= {name: int(n) for name, n in reader.metadata.get("dropped", {}).items()}
    dropped_s = max(
        (n / _RATES_HZ.get(topic.rsplit("/", 1)[-1], 30.0) for topic, n in dropped.items()), default=0.0
    )
    return Kept(path.name, newest_ns, gaps, dropped_s, reader.cut)
