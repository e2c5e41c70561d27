"""Report counts and timing of the loop."""

from __future__ import annotations

import msgspec


class LoopReport(msgspec.Struct, kw_only=True):
    """Counts, times and ends of a loop.

    Attributes:
        end_ns: Time at which it ended.
        ended: ``complete``, ``duration`` (the set time was over), ``stopped`` (asked to) or ``failed``.
        n_contacts: Frames taken in, by finger.
        n_blocks: EMG blocks taken in.
        n_hand_ticks: Ticks of the hand.
        n_vest_ticks: Ticks of the vest, each a frame for every sink that takes them all.
        n_vest_between: Frames between the ticks, each since a picture changed something.
        n_stale_ticks: Vest frames in which a finger was silent for want of a fresh frame, by finger.
        level_ticks: Hand ticks spent on each level, 1 to 5.
    """

    end_ns: int = 0
    ended: str = "failed"
    n_contacts: dict[str, int] = {}
    n_blocks: int = 0
    n_hand_ticks: int = 0
    n_vest_ticks: int = 0
    n_vest_between: int = 0
    n_stale_ticks: dict[str, int] = {}
    level_ticks: dict[int, int] = {}
