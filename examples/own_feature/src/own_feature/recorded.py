"""Read the count from a recording, or from those of a session's folder."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import tega


def grips(recording: Path) -> Iterator[tuple[float, int, bool]]:
    """Yield time in seconds, fingers and firmness of every change."""
    for grip in tega.open_recording(recording).get("/grip", ()):
        yield grip.t_ns / 1e9, grip.fingers, grip.firm
