"""Compare the stages that look on in a simulated lift with the connected ones."""

from __future__ import annotations

from collections import defaultdict
from typing import TYPE_CHECKING, Literal

import msgspec
import numpy as np

from tega.records import BesideContact, BesideIntent, Contact, Intent

if TYPE_CHECKING:
    from tega.records.bus import Bus


class BesideResult(msgspec.Struct, frozen=True, kw_only=True):
    """Answers of a stage beside the connected one in a lift, and how far the two agree.

    Attributes:
        stage: Its name in the recording.
        group: ``metric`` or ``decoder``.
        n: Pictures it measured, or intents it gave.
        mean: Share of the pictures that it calls contact, or its mean level.
        agreement: Share of them with the same answer as the newest one of the connected stage: contact or none, or
            the level.
    """

    stage: str
    group: Literal["metric", "decoder"]
    n: int
    mean: float
    agreement: float


class BesideNotes:
    """Notes the answers of connected stages and of stages beside them.

    Args:
        bus: Carries the records.
    """

    def __init__(self, bus: Bus) -> None:
        self._newest: defaultdict[tuple[str, str], list[tuple[int, int]]] = defaultdict(list)
        self._beside: defaultdict[tuple[str, str], list[tuple[int, int]]] = defaultdict(list)
        bus.subscribe(Contact, lambda c: self._newest["metric", c.finger].append((c.t_ns, c.in_contact)))
        bus.subscribe(Intent, lambda i: self._newest["decoder", ""].append((i.t_ns, i.level)))
        bus.subscribe(BesideContact, lambda c: self._beside[c.stage, c.finger].append((c.t_ns, c.in_contact)))
        bus.subscribe(BesideIntent, lambda i: self._beside[i.stage, ""].append((i.t_ns, i.level)))

    def results(self) -> tuple[BesideResult, ...]:
        """Return the answers of each stage beside the connected one."""
        found = []
        for stage in dict.fromkeys(stage for stage, _ in self._beside):
            own = {finger: rows for (name, finger), rows in self._beside.items() if name == stage}
            group: Literal["metric", "decoder"] = "decoder" if "" in own else "metric"
            values = [value for rows in own.values() for _, value in rows]
            same = [one for finger, rows in own.items() for one in self._same(group, finger, rows)]
            found.append(
                BesideResult(
                    stage=stage,
                    group=group,
                    n=len(values),
                    mean=float(np.mean(values)),
                    agreement=float(np.mean(same)) if same else 0.0,
                )
            )
        return tuple(found)

    def _same(self, group: str, finger: str, rows: list[tuple[int, int]]) -> list[bool]:
        """Return for each row whether the connected stage said the same, newest at that time."""
        newest = self._newest[group, finger]
        stamps = [t_ns for t_ns, _ in newest]
        places = np.searchsorted(stamps, [t_ns for t_ns, _ in rows], side="right") - 1
        return [
            newest[place][1] == value for place, (_, value) in zip(places, rows, strict=True) if place >= 0
        ]
