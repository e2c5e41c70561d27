"""Bound the markers that other programs add to a recording: else one of them could fill the disk."""

from __future__ import annotations

import time
from typing import Final

MARKER_BYTES_PER_S: Final = 50_000
"""Bytes of markers a second that are recorded for long, 180 MB an hour; a megabyte may come at once."""

_BURST_BYTES: Final = 1_000_000
_OVERHEAD_BYTES: Final = 100


class MarkerBudget:
    """Bytes of markers that may still be recorded."""

    def __init__(self) -> None:
        self._left_bytes, self._seen_s = float(_BURST_BYTES), time.monotonic()

    def allows(self, text: str) -> bool:
        """Return whether a marker may be recorded, and count it if it may."""
        now_s = time.monotonic()
        self._left_bytes += (now_s - self._seen_s) * MARKER_BYTES_PER_S
        self._left_bytes, self._seen_s = min(self._left_bytes, _BURST_BYTES), now_s
        n_bytes = _OVERHEAD_BYTES + len(text.encode(errors="replace"))
        allowed = n_bytes <= self._left_bytes
        self._left_bytes -= n_bytes * allowed
        return allowed
