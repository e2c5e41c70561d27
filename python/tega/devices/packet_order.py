"""Drop packets that came twice, and tell which of the losses that their counter shows can be true."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


class PacketOrder:
    """Leaves out packets that came twice.

    Args:
        turn: After how many packets the counter repeats.

    Attributes:
        n_repeated: Packets left out so far.
    """

    def __init__(self, turn: int) -> None:
        self._turn = turn
        self._last: NDArray[np.float64] | None = None
        self.n_repeated = 0

    def once(
        self, samples: NDArray[np.float64], missing: NDArray[np.int64]
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return the packets that are new: of one that came twice one turn less one is missing, and nothing changed.

        Args:
            samples: (n, channels), n at least 1.
            missing: (n,), packets missing before each, by the counter.
        """
        before = (
            samples[:-1] if self._last is None else np.concatenate([self._last[np.newaxis], samples[:-1]])
        )
        first = len(samples) - len(before)
        again = np.zeros(len(samples), np.bool_)
        again[first:] = (missing[first:] == self._turn - 1) & (samples[first:] == before).all(axis=1)
        self._last = samples[-1]
        self.n_repeated += int(again.sum())
        return samples[~again], missing[~again]


def believed_losses(missing: NDArray[np.int64], room: int) -> NDArray[np.int64]:
    """Leave out the largest losses until there was time for the rest: a damaged counter shows losses that are none.

    Args:
        missing: (n,), packets missing before each, by the counter.
        room: How many can be missing, by the time that has passed.

    Example:
        >>> believed_losses(np.array([0, 100, 155, 2]), room=12)
        array([0, 0, 0, 2])
    """
    missing = missing.copy()
    while missing.sum() > room:
        missing[missing.argmax()] = 0
    return missing
