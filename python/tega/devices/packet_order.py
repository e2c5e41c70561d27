"""Drop repeated and damaged packets by comparing their numbers with a counter, and believe true losses."""

from __future__ import annotations

from collections import deque
from typing import Final

import numpy as np
from numpy.typing import NDArray

from tega.runtime.evidence import Contradiction

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
    """Passes on packets with consecutive numbers; their counter repeats after ``turn`` packets.

    A repeated packet is used once. A packet with a number that shows a loss is held until the next packet,
    which must have a later number. Otherwise, or if there was no time for such a loss, the packet is damaged:
    it is discarded and counts as lost. ``hint`` is the next step where the numbers are no counter.
    ``n_repeated`` and ``n_damaged`` count the packets left out.
    """

    def __init__(self, turn: int, *, hint: str = "") -> None:
        self._turn, self._hint = turn, hint
        self._last: NDArray[np.float64] | None = None
        self._ahead = 0  # the newest number received, less that of the newest packet passed on
        self._doubtful: tuple[NDArray[np.float64], int] | None = None
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
            >>> order.once(rows, np.array([0, 100, 156]), room=12)[1]
            array([0, 1])
            >>> order.n_damaged
            1
        """
        if self._ahead == 0 and self._doubtful is None and not missing.any():
            self._kinds.extend([_NEXT] * len(missing))
            self._last, self._n_in_a_row = samples[-1], 0
            return samples, missing
        passed: list[NDArray[np.float64]] = []
        losses: list[int] = []
        for packet, n_missing in zip(samples, missing.tolist(), strict=True):
            self._ahead = (self._ahead + n_missing + 1) % self._turn
            for row, n_lost in self._judge(packet, room - sum(losses)):
                passed.append(row)
                losses.append(n_lost)
        rows = np.array(passed) if passed else samples[:0]
        return rows, np.asarray(losses, np.int64)

    def _judge(self, packet: NDArray[np.float64], room: int) -> list[tuple[NDArray[np.float64], int]]:
        """Return the packets that can be passed on now, each with the number of packets missing before it."""
        before: list[tuple[NDArray[np.float64], int]] = []
        if self._doubtful is not None:
            row, ahead = self._doubtful
            further = (self._ahead - ahead) % self._turn
            if further == 0 and bool((packet == row).all()):
                return self._repeat()
            self._doubtful = None
            if 0 < further <= room + 1:
                before, self._ahead, self._last = [(row, ahead - 1)], further, row
                self._n_in_a_row = 0
                self._kinds.append(_LOSS)
            else:
                self._leave_out(_JUMPS)
        if self._ahead == 0 and self._last is not None and bool((packet == self._last).all()):
            return before + self._repeat()
        n_lost = (self._ahead - 1) % self._turn
        follows = n_lost <= self._n_in_a_row
        if follows or self._last is None or self._n_in_a_row >= _RESYNC:
            # It comes after those left out, or the device has begun to count from elsewhere.
            n_lost = min(n_lost, self._n_in_a_row)
            self._kinds.append(_NEXT if follows else _LOSS)
            self._last, self._ahead, self._n_in_a_row = packet, 0, 0
            return [*before, (packet, n_lost)]
        if n_lost <= room and self._ahead:
            self._doubtful = packet, self._ahead
        else:
            self._leave_out(_JUMPS if self._ahead else _STANDS)
        return before

    def _repeat(self) -> list[tuple[NDArray[np.float64], int]]:
        """Count a packet that came twice."""
        self.n_repeated += 1
        self._kinds.append(_REPEATED)
        return []

    def _leave_out(self, kind: int) -> None:
        """Count a damaged packet."""
        self.n_damaged += 1
        self._n_in_a_row += 1
        self._kinds.append(kind)

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
