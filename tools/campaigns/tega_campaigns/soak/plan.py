"""The faults of a soak, and the order in which a seed puts them."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Final, Literal, NamedTuple

__all__ = ["KINDS", "Kind", "Planned", "plan"]

Then = Literal["recovers", "restarts"]


class Kind(NamedTuple):
    """A fault that can be made.

    Attributes:
        kind: What it stands for.
        device: What it happens to.
        how: The emulator's own word for it, or what the soak itself does.
        told: An alert or a state's reason that begins with one of these reports it.
        then: Whether the run has to go on by itself, or ends and is started again.
        lasts_s: So long it lasts, between these.
    """

    kind: str
    device: str
    how: str
    told: tuple[str, ...]
    then: Then = "recovers"
    lasts_s: tuple[float, float] = (1.0, 3.0)


def _finger(name: str) -> list[Kind]:
    return [
        Kind("unplug", name, "cut", (name,)),
        Kind("freeze", name, "freeze", (name,)),
        Kind("noise", name, "garbage", (name,)),
        Kind("late", name, "slow", (name,)),
        Kind("wrong data", name, "black", (name,)),
        Kind("transport stall", name, "pause", (name,)),
    ]


KINDS: Final[tuple[Kind, ...]] = (
    *_finger("thumb"),
    *_finger("index"),
    *_finger("middle"),
    *_finger("ring"),
    Kind("unplug", "emg", "unplug", ("emg",)),
    Kind("freeze", "emg", "freeze 1", ("emg",)),
    Kind("noise", "emg", "loss 0.9", ("emg",), lasts_s=(2.0, 3.0)),
    Kind("late", "emg", "slow 0.2", ("emg",), lasts_s=(2.0, 3.0)),
    Kind("wrong data", "emg", "garbage 1", ("emg",), lasts_s=(2.0, 3.0)),
    Kind("wrong data", "emg", "signal flat", ("emg",), lasts_s=(2.0, 3.0)),
    Kind("electrode off", "emg", "signal rail", ("emg",)),
    Kind("electrode off", "emg", "signal hum", ("emg",)),
    Kind("freeze", "hand", "freeze", ("hand", "ended"), "restarts"),
    Kind("noise", "hand", "garbage", ("hand",)),
    Kind("late", "hand", "half", ("hand",), lasts_s=(0.2, 0.4)),
    Kind("wrong data", "hand", "babble", ("hand",)),
    Kind("wrong data", "hand", "duplicate", ("hand",)),
    Kind("transport stall", "hand", "silence", ("hand", "ended"), lasts_s=(1.0, 1.5)),
    Kind("too hot", "hand", "hot", ("ended",), "restarts"),
    Kind("unplug", "vest", "refuse", ("vest",)),
    Kind("unplug", "vest", "drop", ("vest",), lasts_s=(0.1, 0.2)),
    Kind("freeze", "vest", "freeze", ("vest",), lasts_s=(2.0, 3.0)),
    Kind("wrong data", "vest", "no-vest", ("vest",)),
    Kind("clock step", "computer", "clock", ("clock",), lasts_s=(0.5, 1.0)),
    Kind("disk full", "computer", "disk", ("recording",), "restarts"),
    Kind("late", "program", "stop", ("the loop", "hand"), lasts_s=(1.2, 1.8)),
    Kind("kill -9", "program", "kill", ("guard",), "restarts"),
)
"""Every fault that a soak makes."""


class Planned(NamedTuple):
    """A fault of the plan.

    Attributes:
        fault: Which.
        wait_s: Quiet time before it.
        lasts_s: How long it lasts.
    """

    fault: Kind
    wait_s: float
    lasts_s: float


def plan(seed: int, *, kinds: Sequence[Kind] = KINDS, n: int = 1000) -> list[Planned]:
    """Put faults in order: every one once, in any order, then again in another.

    The first one is a kill and the second one a full disk where ``kinds`` has them, so that a short soak has both.
    Those that end a run come in every fourth round only, so that a long soak has a run that lasts.

    Args:
        seed: The same one gives the same plan.
        kinds: To choose from.
        n: How many.
    """
    chance = random.Random(seed)
    first = [kind for how in ("kill", "disk") for kind in kinds if kind.how == how]
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
