"""Report problems of a steered hand while it can still be steered, or may come back."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from tega.devices.hand.hand_reports import HandNews


_POLL_S = 0.1
_REPORTED_S = 1.0
# So many in a tenth of a second are a fault, and not a frame that a busy machine lost.
_MANY = 3
_WORDS = {
    "jumps": "joints jump; those angles are not used",
    "incomplete": "positions of a finger are missing",
    "malformed": "messages have a wrong length",
    "unknown": "unknown messages are on its bus",
    "copies": "frames come twice",
    "late": "its positions come late",
}


class HandAlert:
    """Looks at a hand's own counts."""

    def __init__(self) -> None:
        self._next_s = self._until_s = 0.0
        self._counts: dict[str, int] = {}
        self._text = ""

    def __call__(self, seen: HandNews | None) -> str:
        """Return the current problem, for at least a second; ``""`` if there is none, or no report yet."""
        now_s = time.monotonic()
        if now_s < self._next_s:
            return self._text
        self._next_s = now_s + _POLL_S
        if text := "" if seen is None else self._check(seen):
            self._text, self._until_s = text, now_s + _REPORTED_S
        elif now_s >= self._until_s:
            self._text = ""
        return self._text

    def _check(self, seen: HandNews) -> str:
        state = seen.state
        if state.phase in {"silent", "listening", "identifying", "checking"}:
            return "hand: silent; it has not confirmed the command to switch its motors off; reconnecting"
        counts = {name: getattr(state.counts, name) for name in _WORDS} | {"garbled": seen.n_garbled}
        before, self._counts = self._counts, counts
        more = {name: n - before.get(name, n) for name, n in counts.items()}
        name = max(more, key=lambda name: more[name])
        if more[name] < _MANY:
            return ""
        return f"hand: {_WORDS.get(name, 'its adapter sends noise')}"
