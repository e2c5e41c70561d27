"""Measure how far other decoders are from the connected one: now, and over the last ten seconds."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from tega.records import BesideIntent, Intent

__all__ = ["DecodersApart", "closure_of"]

OVER_NS: Final = 10_000_000_000
# A level is a quarter of the closure.
_APART_CLOSURE = 0.125
# Both are told in threads of their own, so what belongs to the same moment comes a little sooner or later.
_SAME_NS = 250_000_000
_MOST = 4096


class DecodersApart:
    """Compares intents of decoders with the same input, as they arrive; thread-safe.

    Two are apart where their closures differ by more than half a level.
    """

    def __init__(self) -> None:
        self._connected: deque[tuple[int, float]] = deque(maxlen=_MOST)
        self._beside: dict[str, deque[tuple[int, float]]] = {}

    def connected(self, intent: Intent) -> None:
        """Add an intent of the connected decoder."""
        self._connected.append((intent.t_ns, closure_of(intent)))

    def beside(self, intent: BesideIntent) -> None:
        """Add an intent of a decoder beside it."""
        self._beside.setdefault(intent.stage, deque(maxlen=_MOST)).append((intent.t_ns, closure_of(intent)))

    def rows(self) -> dict[str, str]:
        """Return a line of text for each decoder beside: its closure, and in how much of ten seconds it was apart."""
        connected = list(self._connected)
        if not connected:
            return {}
        now_ns = connected[-1][0]
        rows = {}
        for stage, reported in list(self._beside.items()):
            recent = [one for one in list(reported) if now_ns - OVER_NS < one[0] <= now_ns]
            pairs = _paired(connected, recent)
            if pairs:
                apart = sum(abs(a - b) > _APART_CLOSURE for a, b in pairs) / len(pairs)
                ours, theirs = pairs[-1]
                rows[f"beside {stage}"] = (
                    f"closure {theirs:.2f} (connected {ours:.2f}), apart in {100 * apart:.0f} % of 10 s"
                )
        return rows


def closure_of(intent: Intent | BesideIntent) -> float:
    """Return the closure that an intent asks for, 0 to 1, also of a decoder that knows levels alone."""
    return (intent.level - 1) / 4 if intent.closure is None else intent.closure


def _paired(connected: list[tuple[int, float]], beside: list[tuple[int, float]]) -> list[tuple[float, float]]:
    """Pair each closure beside with the connected decoder's last one by that time."""
    pairs, at = [], 0
    for t_ns, closure in beside:
        while at + 1 < len(connected) and connected[at + 1][0] <= t_ns:
            at += 1
        if 0 <= t_ns - connected[at][0] <= _SAME_NS:
            pairs.append((connected[at][1], closure))
    return pairs
