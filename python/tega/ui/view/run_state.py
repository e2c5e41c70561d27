"""Describe a run for displays: rates, contact names that do not flicker, states and what they mean, text beside."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from tega.hand import split_level
from tega.haptics import HIGH_SHARE, ContactType, contact_type
from tega.loop.snapshot import LoopView
from tega.records import Contact
from tega.runtime.words import number_text


class RateMeter:
    """Turns counts that rise into rates over the last full second, by name; empty before one is over."""

    def __init__(self) -> None:
        self.rates_hz: dict[str, float] = {}
        self._since_s, self._before = 0.0, dict[str, int]()

    def take(self, now_s: float, counts: Mapping[str, int]) -> None:
        """Take the counts of now; where one is lower than before, another run began, which counts from 0 again."""
        passed_s = now_s - self._since_s
        if self._before and all(n >= self._before.get(name, 0) for name, n in counts.items()):
            if passed_s < 1.0:
                return
            self.rates_hz = {name: (n - self._before.get(name, 0)) / passed_s for name, n in counts.items()}
        self._since_s, self._before = now_s, dict(counts)


BAND = 0.05
"""A share is called high from 0.55 of its maximum on, and stays so down to 0.45.

Wider than EDA's largest jump between two frames of a steady press, 4 % (docs/evidence/touch-live.md).
"""


class ContactLabels:
    """Names each finger's contact by the rule of :func:`tega.haptics.contact_type`, with hysteresis.

    A new contact is named by the rule itself. A share that was high stays so until it is clearly under the border, and
    the other way round. It is for displays: the vest's columns have no borders.
    """

    def __init__(self) -> None:
        self._high: dict[str, tuple[bool, bool]] = {}

    def name(self, contact: Contact) -> ContactType:
        """Return the label of a finger's newest contact."""
        finger, shares = contact.finger, (contact.cci_norm, contact.eda_norm)
        if not contact.in_contact or contact.eda_norm == 0:
            self._high.pop(finger, None)
            return "none"
        before = self._high.get(finger)
        if before is None:
            cci, eda = (share >= HIGH_SHARE for share in shares)
        else:
            cci, eda = (
                share >= (HIGH_SHARE - BAND if was else HIGH_SHARE + BAND)
                for share, was in zip(shares, before, strict=True)
            )
        self._high[finger] = cci, eda
        return contact_type(1.0 if cci else 0.0, 1.0 if eda else HIGH_SHARE / 2)


_WITH_HAND: Final = {
    "idle": "the hand is open",
    "armed": "ready; waiting for the start",
    "active": "the muscles steer the hand",
    "hold": "the hand keeps its level",
}
_WITHOUT_HAND: Final = {
    "idle": "level 1",
    "armed": "ready; waiting for the start",
    "active": "the muscles are decoded",
    "hold": "the level is kept",
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
    if view.angles_rad is None and "hand" not in view.devices:
        return "no hand connected" if not view.command else f"command {command}"
    if view.angles_rad is None:
        return f"command {command}; no angles reported"
    bends = [sum(view.angles_rad[4 * finger + 1 : 4 * finger + 4]) for finger in range(4)]
    source = "reported" if "hand" in view.devices else "modelled"
    return f"command {command}; {source} bend {' '.join(f'{bend:.2f}' for bend in bends)} rad"


def _vest(view: LoopView) -> str:
    if view.vest is None:
        return "no frame yet" if "vest" in view.devices else "no vest connected"
    values = view.vest.intensities
    source = "sent" if "vest" in view.devices else "computed, no vest connected"
    n_on = int((values > 0).sum())
    text = f"{n_on} of {len(values)} motors on, up to {int(values.max())} %" if n_on else "all motors at 0 %"
    return f"{source}: {text}"
