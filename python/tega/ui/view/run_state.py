"""Describe the run's states for displays: each one's meaning for the connected devices, and the text beside it."""

from __future__ import annotations

import math
from typing import Final

from tega.hand import split_level
from tega.loop.snapshot import LoopView
from tega.runtime.words import number_text

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


SILENT_NS: Final = 400_000_000
"""A decoded level older than this is not current, nanoseconds: twice the time after which a block is late."""

_POSES = ("open", "pre-shape", "half", "wrap", "tight")


def device_rows(view: LoopView) -> dict[str, str]:
    """Return the rows ``muscles``, ``hand`` and ``vest``, texts by name.

    The decoder's level, the level that the hand was commanded, the angles that it reported, and the
    intensities that the vest confirmed stay apart. After the end of a run nothing is commanded.
    """
    return {"muscles": _muscles(view), "hand": _hand(view), "vest": _vest(view)}


def level_words(level: float) -> str:
    """Return a closure level with the name of its pose, such as ``level 3: half``."""
    whole = split_level(level)[0]
    return f"level {number_text(round(level, 1))}: {_POSES[whole - 1]}"


def _muscles(view: LoopView) -> str:
    intent = view.intent
    if intent is None:
        return "no EMG yet" if "emg" in view.devices else "no EMG connected"
    if view.state == "stopped":
        return "decoder off"
    decoded = level_words(intent.level)
    if (age_ns := view.t_ns - intent.t_ns) > SILENT_NS:
        return f"no data for {age_ns / 1e9:.1f} s, last {decoded}"
    channels = " · ".join(map(str, intent.channels))
    return f"{decoded}; channels {channels}" if channels else decoded


def _hand(view: LoopView) -> str:
    command = level_words(view.command) if view.command else "zero torque"
    if view.angles_rad is None:
        return "no hand connected" if not view.command else f"command {command}"
    bends = [sum(view.angles_rad[4 * finger + 1 : 4 * finger + 4]) for finger in range(4)]
    source = "reported" if "hand" in view.devices else "modelled"
    if not all(map(math.isfinite, bends)):
        return f"command {command}; no angles {source}"
    return f"command {command}; {source} bend {' '.join(f'{bend:.2f}' for bend in bends)} rad"


def _vest(view: LoopView) -> str:
    if view.vest is None:
        return "no frame yet" if "vest" in view.devices else "no vest connected"
    values = view.vest.intensities
    source = "sent" if "vest" in view.devices else "computed, no vest connected"
    n_on = int((values > 0).sum())
    text = f"{n_on} of {len(values)} motors on, up to {int(values.max())} %" if n_on else "all motors at 0 %"
    return f"{source}: {text}"
