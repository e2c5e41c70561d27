"""Command the hand's level without EMG or decoder: a ladder from an ideal hand to the real one.

Three ways from the person to the hand. ``decoder``: the muscles' EMG, and the decoder that reads it, as in a run.
``drive``: the muscles' drive, with its errors of aim, lags and slackening, read without the EMG's noise. ``aim``: the
level that the person aims at, as if muscles made no error.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Literal, Protocol, TypeAlias

from msgspec.structs import replace

if TYPE_CHECKING:
    from tega.records import Intent
    from tega.runtime.device_items import EmgChunk

HandRoute: TypeAlias = Literal["decoder", "drive", "aim"]
"""Source of the hand's level, see above."""


class BlockSource(Protocol):
    """Maker of blocks of EMG, such as :class:`tega.loop.inbox.sources.BlockMeter`."""

    def take(self, chunk: EmgChunk) -> list[Intent]:
        """Take the next samples, and return the blocks that they complete."""
        ...


class StraightBlocks:
    """Blocks of EMG at the times of the real ones, which ask for a level that did not come from it.

    Args:
        blocks: Makes the real ones.
        level: Asked for the level, 1 to 5, as a block ends.
    """

    def __init__(self, blocks: BlockSource, level: Callable[[], int]) -> None:
        self._blocks, self._level = blocks, level

    def take(self, chunk: EmgChunk) -> list[Intent]:
        """Take the next samples, and return the blocks that they complete, with the level in the place of theirs."""
        return [
            replace(intent, level=self._level(), closure=None, confidence=None)
            for intent in self._blocks.take(chunk)
        ]


def level_of_drive(excitation: float, full_effort: float) -> int:
    """Return the level of the quarter of effort that contains a drive, 1 to 5, like a decoder without noise.

    Args:
        excitation: Drive of the grip muscles, share of the strongest.
        full_effort: Drive at which a channel's mean is Emax.
    """
    return min(1 + int(4 * excitation / full_effort), 5)
