"""Describe the run's states for displays: each one's meaning for the connected devices, and the text beside it."""

from __future__ import annotations

from typing import Final

from tega.loop.snapshot import LoopView

_WITH_HAND: Final = {
    "idle": "the hand is open",
    "armed": "ready; waiting for the start",
    "active": "the muscles steer the hand",
    "hold": "the hand keeps its level",
    "stopped": "",
}
_WITHOUT_HAND: Final = {
    "idle": "level 1",
    "armed": "ready; waiting for the start",
    "active": "the muscles are decoded",
    "hold": "the level is kept",
    "stopped": "",
}

NO_NEWS_S: Final = 1.5
"""After so long without a new moment of the run a display says so, seconds; the loop shows one 30 times a second."""
NO_NEWS: Final = "no news from the run for"


def meaning(view: LoopView) -> str:
    """Return the effect of a state on the devices that are connected; ``""`` for a run that has ended."""
    if view.state == "stopped":
        return ""
    with_hand, with_vest = "hand" in view.devices, "vest" in view.devices
    parts = []
    if "emg" in view.devices or with_hand or view.state == "armed":
        parts.append((_WITH_HAND if with_hand else _WITHOUT_HAND)[view.state])
    if with_vest and view.state == "active":
        parts.append("the vest shows touch")
    elif with_vest and view.state == "idle":
        parts.append("the vest rests")
    missing = [name for name in ("hand", "vest") if name not in view.devices]
    if missing:
        parts.append(f"no {' and no '.join(missing)} connected")
    return ", ".join(parts)


def lines_beside(view: LoopView) -> tuple[str, list[str]]:
    """Return the reason for the run's state, ``""`` where that is good news, and the other alerts."""
    reason = "" if view.state == "active" else view.reason
    return reason, [alert for alert in view.alerts if not reason or alert not in reason]
