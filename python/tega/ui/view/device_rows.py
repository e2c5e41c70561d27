"""Describe in one line each the muscles as decoded, the hand as commanded and reported, and the vest as sent."""

from __future__ import annotations

import math
from typing import Final

from tega.hand import split_level
from tega.loop.snapshot import LoopView
from tega.runtime.number_text import number_text

SILENT_NS: Final = 400_000_000
"""A decoded level older than this is not current, nanoseconds: twice the time after which a block is late."""

_POSES = ("open", "pre-shape", "half", "wrap", "tight")


def device_rows(view: LoopView) -> dict[str, str]:
    """Return the rows ``muscles``, ``hand`` and ``vest``.

    Returns:
        Texts by name. The decoder's level, the level that the hand was commanded, the angles that it reported, and
        the intensities that the vest confirmed stay apart. After the end of a run nothing is commanded.
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
