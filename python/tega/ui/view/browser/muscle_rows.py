"""Describe the muscles in lines of text: decoder, online adaptation, and condition."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence
from typing import Final

from tega.records import Adaptation, BesideIntent, Intent, MuscleCondition
from tega.records.bus import Bus

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


class MuscleRows:
    """Keeps the newest records of a run about its muscles; thread-safe."""

    def __init__(self, bus: Bus) -> None:
        self._apart = DecodersApart()
        self._intent: Intent | None = None
        self._adaptation: Adaptation | None = None
        self._condition: MuscleCondition | None = None
        bus.subscribe(Intent, self._decoded, name="page")
        bus.subscribe(BesideIntent, self._apart.beside, name="page")
        bus.subscribe(Adaptation, self._adapted, name="page")
        bus.subscribe(MuscleCondition, self._looked, name="page")

    def _decoded(self, intent: Intent) -> None:
        self._intent = intent
        self._apart.connected(intent)

    def _adapted(self, change: Adaptation) -> None:
        self._adaptation = change

    def _looked(self, condition: MuscleCondition) -> None:
        self._condition = condition

    def rows(self, holds: str = "") -> dict[str, str]:
        """Return a line of text by its name; unknown facts have no line.

        ``holds`` is why the decoder holds its closure, in its own words; ``""`` if it does not.
        """
        rows = {"decoder": self._decoder(holds), **self._apart.rows()}
        if (change := self._adaptation) is not None:
            gains = " · ".join(f"{gain:.2f}" for gain in change.gains)
            rows["adaptation"] = "undone" if change.why == "undone" else f"gains {gains} ({change.why})"
        if (condition := self._condition) is not None:
            rows["fatigue"] = _fatigue(condition)
            if math.isfinite(condition.pattern_change):
                rows["electrodes"] = f"pattern {100 * condition.pattern_change:.0f} % off the run's first"
        return {name: text for name, text in rows.items() if text}

    def _decoder(self, holds: str) -> str:
        """Say the closure and how sure it is, or that it is held and why; nothing of levels alone."""
        intent = self._intent
        if intent is None:
            return ""
        if intent.channels and not any(intent.channels):
            holds = "no channel can be believed"
        if holds:
            return f"holds closure {closure_of(intent):.2f}: {holds}"
        if intent.confidence is None:
            return ""
        return f"closure {closure_of(intent):.2f}, {100 * intent.confidence:.0f} % sure"


def _fatigue(condition: MuscleCondition) -> str:
    """Say the median frequencies and how fast they fall or rise; nothing where the source has no spectrum."""
    if not any(map(math.isfinite, condition.median_hz)):
        return ""
    message = f"median frequency {_reported(condition.median_hz, '.0f')} Hz"
    if any(map(math.isfinite, condition.slope_percent_per_min)):
        message += f", {_reported(condition.slope_percent_per_min, '+.1f')} %/min"
    return message


def _reported(values: Sequence[float], form: str) -> str:
    return " · ".join(format(value, form) if math.isfinite(value) else "–" for value in values)
