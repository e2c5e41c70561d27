"""Bound the markers that other programs add to a recording: else one of them could fill the disk."""

from __future__ import annotations

import time


class MarkerBudget:
    """Room for markers in a recording: 50 kB a second, after a first megabyte; ``n_left_out`` had none."""

    def __init__(self) -> None:
        self._left_bytes, self._seen_s, self.n_left_out = 1e6, time.monotonic(), 0

    def problem(self, text: str) -> str:
        """Take room for a marker; return why there is none, ``""`` if there is."""
        earlier_s, self._seen_s = self._seen_s, time.monotonic()
        self._left_bytes = min(self._left_bytes + (self._seen_s - earlier_s) * 5e4, 1e6)
        n_bytes = 100 + len(text.encode(errors="replace"))
        if n_bytes <= self._left_bytes:
            self._left_bytes -= n_bytes
            return ""
        self.n_left_out += 1
        return f"too many markers: more than 50 kB a second, {self.n_left_out} not recorded; send fewer or shorter ones"
