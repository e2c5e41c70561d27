"""A trial is one driver, one fault, one run; its outcome is a line of the table."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final, Literal, NamedTuple

import msgspec

__all__ = ["FAULTS", "DriverOutcome", "Effect", "FaultTrial", "all_trials"]

FAULTS: Final = {
    "unplug": "The device is taken away, and in the end put back.",
    "freeze": "It stands still; its port stays.",
    "garbage": "Its data are random or invalid.",
    "half packet": "Its data are cut off.",
    "wrong version": "It is there, but not the one that is needed.",
    "slow": "It sends or receives too slowly.",
    "duplicate": "It sends things twice.",
    "power cycle": "It is switched off and on again.",
}
"""The faults that every driver is tried with; others belong to some."""

Effect = Literal["refused", "ends", "falls silent", "lets go", "goes on"]
"""How it ends: opening is refused; reading raises and the run goes on without; no data or touch, and again later; the
device is made safe and given up; or nothing that a person notices."""


class DriverOutcome(msgspec.Struct, frozen=True, kw_only=True):
    """What a driver made of a fault.

    Attributes:
        effect: How it ended.
        seen_s: From the fault to that; ``None`` where there is nothing to wait for.
        back_s: From the fault's end to fresh data or the right touch again; ``None`` where it did not come, or
            never went.
        said: What the driver did or said, as a sentence.
    """

    effect: Effect
    said: str
    seen_s: float | None = None
    back_s: float | None = None


class FaultTrial(NamedTuple):
    """One driver and one fault.

    Attributes:
        driver: Its name, with the setting that matters in brackets if there is one.
        fault: One of :data:`FAULTS`, or the fault's own name.
        what: What the emulator does.
        run: Tries it.
    """

    driver: str
    fault: str
    what: str
    run: Callable[[], DriverOutcome]


def all_trials() -> tuple[list[FaultTrial], dict[tuple[str, str], str]]:
    """Return every trial, and why some drivers cannot meet some fault of :data:`FAULTS`."""
    from tega_campaigns.faults import emg, hand, inputs, tactile, vests

    trials: list[FaultTrial] = []
    cannot: dict[tuple[str, str], str] = {}
    for group in (tactile, emg, vests, hand, inputs):
        trials += group.trials()
        cannot |= group.CANNOT
    return trials, cannot
