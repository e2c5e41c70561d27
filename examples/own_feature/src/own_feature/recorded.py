"""Read the count from a recording."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

from tega.recording.mcap_reader import McapReader


def grips(recording: Path) -> Iterator[tuple[float, int, bool]]:
    """Yield time in seconds, fingers and firmness of every change."""
    for message in McapReader(recording).messages():
        if message.topic == "/grip":
            yield message.value.t_ns / 1e9, message.value.fingers, message.value.firm
