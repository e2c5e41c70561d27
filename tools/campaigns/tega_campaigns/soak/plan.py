"""The faults of a soak, and the order in which a seed puts them."""

from __future__ import annotations

import random
import re
from collections.abc import Mapping, Sequence
from typing import Any, Final, Literal, NamedTuple

__all__ = ["KINDS", "STATION_KINDS", "Kind", "Planned", "plan"]

Then = Literal["recovers", "restarts"]


class Kind(NamedTuple):
    """A fault that can be made.

    Attributes:
        kind: What it stands for.
        how: The emulator's own word for it, or what the soak itself does.
        reported: Pattern of how words that report it begin: an alert, a state's reason, ``arm`` with what it
            does and why, or ``ended:`` with the last words of a run.
        then: Whether the run has to go on by itself, or ends and is started again.
        lasts_s: So long it lasts, between these.
    """

    kind: str
    device: str
    how: str
    reported: str
    then: Then = "recovers"
    lasts_s: tuple[float, float] = (1.0, 3.0)

    def words(self, text: Mapping[str, Any]) -> str:
        """Return what of a line of the program reports this fault; ``""`` where nothing does."""
        every: list[str] = []
        if "ended" in text:
            # The error's class stands before its words.
            every.append(f"ended: {str(text['ended']).partition(': ')[2]}")
        elif "said" not in text:  # that is for a person, of the link
            every += text.get("alerts", ())
            every.append(text.get("reason", "") if text.get("state") in {"hold", "idle", "armed"} else "")
            every.append(f"arm {text.get('arm', '')}")
        return next((words for words in every if re.match(self.reported, words)), "")


def _finger(name: str) -> list[Kind]:
    return [
        Kind("unplug", name, "cut", f"{name}:"),
        Kind("freeze", name, "freeze", f"{name}:"),
        Kind("noise", name, "garbage", f"{name}:"),
        Kind("late", name, "slow", f"{name}:"),
        Kind("wrong data", name, "black", f"{name}:"),
        Kind("transport stall", name, "pause", f"{name}:"),
    ]


# A hand whose guard was lost suffers from another fault.
_HAND = "hand: (?!the process)"
_LET_GO = "(holding|idle|stopped):"
_TRACKER = (
    "hololens:|arm: (the forearm is lost|there was no pose yet|the tracker has no vote)"
    f"|arm {_LET_GO} (the forearm is lost|there was no pose yet|no pose came|the tracker has no vote)"
)
_ARM = f"simulated-arm: the arm's process has said nothing|arm {_LET_GO} the arm did not report its position"
_RECORDER = "the recorder's process"

KINDS: Final[tuple[Kind, ...]] = (
    *_finger("thumb"),
    *_finger("index"),
    *_finger("middle"),
    *_finger("ring"),
    Kind("unplug", "emg", "unplug", "emg:"),
    Kind("freeze", "emg", "freeze 1", "emg:"),
    Kind("noise", "emg", "loss 0.9", "emg:", lasts_s=(2.0, 3.0)),
    Kind("late", "emg", "slow 0.2", "emg:", lasts_s=(2.0, 3.0)),
    Kind("wrong data", "emg", "garbage 1", "emg:", lasts_s=(2.0, 3.0)),
    Kind("wrong data", "emg", "signal flat", "emg:", lasts_s=(2.0, 3.0)),
    Kind("electrode off", "emg", "signal rail", "emg:"),
    Kind("electrode off", "emg", "signal hum", "emg:"),
    Kind("freeze", "hand", "freeze", "ended: allegro: no joint angle has changed", "restarts"),
    Kind("noise", "hand", "garbage", _HAND),
    Kind("late", "hand", "half", _HAND, lasts_s=(0.2, 0.4)),
    Kind("wrong data", "hand", "babble", _HAND),
    Kind("wrong data", "hand", "duplicate", _HAND),
    Kind("transport stall", "hand", "silence", "hand: silent", lasts_s=(1.0, 1.5)),
    Kind("too hot", "hand", "hot", r"ended: allegro: \w+ is at \d+ °C", "restarts"),
    Kind("unplug", "vest", "refuse", "vest:"),
    Kind("unplug", "vest", "drop", "vest:", lasts_s=(0.1, 0.2)),
    Kind("freeze", "vest", "freeze", "vest:", lasts_s=(2.0, 3.0)),
    Kind("switched off", "vest", "off", "vest:"),
    Kind("unplug", "pedal", "unplug", "dead-man:"),
    Kind("freeze", "pedal", "freeze", "dead-man:"),
    Kind("noise", "pedal", "garbage", "dead-man:"),
    Kind("wrong data", "pedal", "half", "dead-man:"),
    Kind("late", "pedal", "slow", "dead-man:"),
    Kind("unplug", "tracker", "hide", _TRACKER, lasts_s=(0.5, 3.0)),
    Kind("freeze", "tracker", "freeze", _TRACKER, lasts_s=(0.5, 3.0)),
    Kind("noise", "tracker", "guess", _TRACKER),
    Kind("late", "tracker", "late 400", _TRACKER),
    Kind("wrong data", "tracker", "same", _TRACKER),
    Kind("wrong data", "tracker", "nan", _TRACKER),
    Kind("wrong data", "tracker", "odd-size", _TRACKER),
    Kind("out of sight", "tracker", "lose", _TRACKER),
    Kind("freeze", "arm", "stop", _ARM),
    Kind("kill -9", "arm", "kill", "(arm stopped: )?simulated-arm: the arm's process has ended", "restarts"),
    Kind("clock step", "computer", "clock", "clock:", lasts_s=(0.5, 1.0)),
    Kind("disk full", "computer", "disk", f"recording: stopped: (?!{_RECORDER})", "restarts"),
    Kind("kill -9", "recorder", "kill", f"recording: stopped: {_RECORDER}", "restarts"),
    Kind("late", "program", "stop", f"the loop was|{_HAND}", lasts_s=(1.2, 1.8)),
    Kind("kill -9", "program", "kill", "guard", "restarts"),
)
"""Every fault that a soak of one program makes."""

_LINK = "link:"
STATION_KINDS: Final[tuple[Kind, ...]] = (
    *(kind for kind in KINDS if kind.device != "program"),
    Kind("unplug", "link", "cut", _LINK),
    Kind("transport stall", "link", "stall", _LINK),
    Kind("late", "link", "delay_ms 400", _LINK),
    Kind("noise", "link", "loss 0.3", _LINK, lasts_s=(2.0, 3.0)),
    Kind("late", "robot", "stop", f"the loop was|{_HAND}|link:", lasts_s=(1.2, 1.8)),
    Kind("late", "operator", "stop", _LINK, lasts_s=(1.2, 1.8)),
    Kind("kill -9", "robot", "kill", "guard", "restarts"),
    Kind("kill -9", "operator", "kill", "guard", "restarts"),
)
"""Every fault that a soak of two stations makes."""

_FIRST = (("program", "kill"), ("robot", "kill"), ("computer", "disk"))


class Planned(NamedTuple):
    """A fault of the plan, after ``wait_s`` of quiet time."""

    fault: Kind
    wait_s: float
    lasts_s: float


def plan(seed: int, *, kinds: Sequence[Kind] = KINDS, n: int = 1000) -> list[Planned]:
    """Put ``n`` faults in order: every one once, in any order, then again in another.

    The first one is a kill of the program and the second one a full disk where ``kinds`` has them, so that a
    short soak has both. Those that end a run come in every fourth round only, so that a long soak has a run
    that lasts. The same seed gives the same plan.
    """
    chance = random.Random(seed)
    first = [kind for subject in _FIRST for kind in kinds if (kind.device, kind.how) == subject]
    order: list[Kind] = []
    n_rounds = 0
    while len(order) < n:
        ends = n_rounds % 4 == 0 or all(kind.then == "restarts" for kind in kinds)
        n_rounds += 1
        deck = [kind for kind in kinds if ends or kind.then == "recovers"]
        chance.shuffle(deck)
        if not order:
            deck = first + [kind for kind in deck if kind not in first]
        order += deck
    return [
        Planned(kind, round(chance.uniform(0.5, 1.5), 3), round(chance.uniform(*kind.lasts_s), 3))
        for kind in order[:n]
    ]
