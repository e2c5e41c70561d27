"""Describe the run's states for displays: what each means, and what is to be read beside it."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

if TYPE_CHECKING:
    from tega.loop.moment import LoopView

__all__ = ["MEANINGS", "NO_NEWS", "NO_NEWS_S", "lines_beside"]

MEANINGS: Final = {
    "idle": "the hand is open, the vest rests",
    "armed": "ready; waiting for the start",
    "active": "the muscles steer the hand",
    "hold": "the hand keeps its level",
    "stopped": "",
}
"""What the devices do in each state."""

NO_NEWS_S: Final = 1.5
"""After so long without a new moment of the run a display says so, seconds; the loop shows one 30 times a second."""
NO_NEWS: Final = "no news from the run for"


def lines_beside(view: LoopView) -> tuple[str, list[str]]:
    """Return why the run is in its state, ``""`` where that is good news, and what is wrong besides.

    Args:
        view: A moment with a state.
    """
    reason = "" if view.state == "active" else view.reason
    return reason, [alert for alert in view.alerts if not reason or alert not in reason]
