"""A source that somebody else looks on at: what the loop reads is seen on the way."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Generic, TypeVar

__all__ = ["Watched"]

Item = TypeVar("Item")


class Watched(Generic[Item]):
    """A source whose items somebody else sees first; otherwise the source itself.

    Args:
        source: A tactile or EMG source.
        see: Told of each item, in the thread that reads.
    """

    def __init__(self, source: Any, see: Callable[[Item], None]) -> None:
        self._source = source
        self._see = see

    def __getattr__(self, name: str) -> Any:
        """Return what the source has under a name."""
        return getattr(self._source, name)

    def read(self, timeout_s: float) -> Item | None:
        """Wait for the next item; see the source's own."""
        item: Item | None = self._source.read(timeout_s)
        if item is not None:
            self._see(item)
        return item
