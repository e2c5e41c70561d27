"""Compare the numbers of a device's packets with a counter: drop repeated and damaged packets, believe true losses."""

from __future__ import annotations

from collections import deque
from typing import TYPE_CHECKING, Final

import numpy as np

from tega.devices.evidence import Contradiction

if TYPE_CHECKING:
    from numpy.typing import NDArray

# The newest packets that are compared; a judgement needs half of them.
_WINDOW: Final = 64
# With more packets than this share that follow no other, the numbers are no counter.
_BAD_SHARE: Final = 0.25
# With more packets than this share that repeat the number before, the counter stands.
_STANDING_SHARE: Final = 0.75
# After so many damaged packets in a row, the device has begun to count from elsewhere.
_RESYNC: Final = 8

_NEXT, _LOSS, _REPEATED, _STANDS, _JUMPS = range(5)


class PacketOrder:
    """Passes on the packets whose number follows that of the packet before.

    A packet that came twice is used once. A packet whose number shows a loss that there was no time for is damaged: its
    bytes are not believed, and it is left out as if it were lost.

    Args:
        turn: After how many packets the counter repeats.
        hint: The next step where the numbers are no counter.

    Attributes:
        n_repeated: Packets left out so far because they came twice.
        n_damaged: Packets left out so far because their number cannot be true.
    """

    def __init__(self, turn: int, *, hint: str = "") -> None:
        self._turn, self._hint = turn, hint
        self._last: NDArray[np.float64] | None = None
        self._ahead = 0  # the newest number received, less that of the newest packet passed on
        self._n_in_a_row = 0
        self._kinds: deque[int] = deque(maxlen=_WINDOW)
        self.n_repeated = self.n_damaged = 0

    def once(
        self, samples: NDArray[np.float64], missing: NDArray[np.int64], room: int = 2**31
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the packets that are new and whole, with the number of packets that are missing before each.

        Args:
            samples: (n, channels), n at least 1.
            missing: (n,), packets missing before each, by the counter, modulo ``turn``.
            room: How many packets can be missing in all, by the time that has passed.

        Example:
            >>> order, rows = PacketOrder(256), np.arange(3.0)[:, np.newaxis]
            >>> order.once(rows, np.array([0, 100, 155]), room=12)[1]
            array([0, 1])
            >>> order.n_damaged
            1
        """
        if self._ahead == 0 and not missing.any():
            self._kinds.extend([_NEXT] * len(missing))
            self._last, self._n_in_a_row = samples[-1], 0
            return samples, missing
        kept, losses = list[int](), list[int]()
        for k, n_missing in enumerate(missing.tolist()):
            self._ahead = (self._ahead + n_missing + 1) % self._turn
            kind, n_lost = self._judge(samples[k], room)
            self._kinds.append(kind)
            if kind in {_NEXT, _LOSS}:
                room -= n_lost
                kept.append(k)
                losses.append(n_lost)
                self._last, self._ahead, self._n_in_a_row = samples[k], 0, 0
        return samples[kept], np.asarray(losses, np.int64)

    def _judge(self, packet: NDArray[np.float64], room: int) -> tuple[int, int]:
        """Return the kind of a packet and, for one to pass on, the number of packets missing before it."""
        if self._ahead == 0 and self._last is not None and bool((packet == self._last).all()):
            self.n_repeated += 1
            return _REPEATED, 0
        n_lost = (self._ahead - 1) % self._turn
        if n_lost == 0:
            return _NEXT, 0
        if n_lost <= room and self._ahead:
            return _LOSS, n_lost
        self._n_in_a_row += 1
        if self._n_in_a_row > _RESYNC:
            return _LOSS, min(room, _RESYNC)  # those left out took their time
        self.n_damaged += 1
        return (_JUMPS if self._ahead else _STANDS), 0

    @property
    def contradiction(self) -> Contradiction | None:
        """Contradiction between the newest packets' numbers and a counter; ``None`` for none, or too few packets."""
        n = len(self._kinds)
        if 2 * n < _WINDOW:
            return None
        standing = self._kinds.count(_REPEATED) + self._kinds.count(_STANDS)
        bad = self._kinds.count(_STANDS) + self._kinds.count(_JUMPS)
        if standing > _STANDING_SHARE * n:
            return Contradiction(
                "counter", f"the counter does not move in {standing} of {n} packets", self._hint
            )
        if bad > _BAD_SHARE * n:
            found = f"the counter does not move by one in {bad} of {n} packets"
            return Contradiction("counter", found, self._hint)
        return None
