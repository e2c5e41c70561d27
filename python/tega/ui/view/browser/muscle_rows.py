"""Describe the muscles in lines of text: decoder, online adaptation, and condition."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from tega.records import Adaptation, BesideIntent, Intent, MuscleCondition
from tega.ui.view.browser.decoders_apart import DecodersApart, closure_of

if TYPE_CHECKING:
    from tega.records.bus import Bus

__all__ = ["MuscleRows"]


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

        Args:
            holds: Reason why the decoder holds its closure, in its own words; ``""`` if it does not.
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
