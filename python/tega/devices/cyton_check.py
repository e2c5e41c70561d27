"""Check that a Cyton's even-numbered and odd-numbered packets carry the same electrodes.

With a Daisy on the board, packets of even number carry channels 9 to 16 in the places of 1 to 8, and nothing in a
packet says so. Neighbouring samples of one electrode have the same middle and spread; those of two electrodes do not.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Final

import numpy as np
from numpy.typing import NDArray

# Packets in one comparison, half of them of even number: 0.4 s.
_WINDOW: Final = 100
# So many comparisons on end have to agree.
_AGREE: Final = 2
# Middles further apart than so many standard errors, or spreads by more than this ratio, are two electrodes.
_ERRORS: Final = 8.0
_RATIO: Final = 4.0
# Differences of so many steps of the converter are no differences.
_LEAST_STEPS: Final = 3.0
# A channel that is switched off stands still; a shifted byte moves it by 1.5 mV at least.
_OFF_UV: Final = 1000.0
# Standard deviation of a normal distribution over its median absolute deviation.
_SD_OF_MAD: Final = 1.4826


class AlternationCheck:
    """Compares the packets of one stream as they come.

    Args:
        used: The channels that are switched on, from 1.
        step_uv: One step of the converter, µV.

    Attributes:
        found: The difference, in words; ``""`` for none.
        is_decided: Whether enough packets were compared.

    Example:
        >>> check, rng = AlternationCheck([1, 2, 3], step_uv=0.022), np.random.default_rng(1)
        >>> volts = np.zeros((200, 8))
        >>> volts[::2, :3] = 11_000 + rng.normal(0, 1, (100, 3))
        >>> check.take(np.arange(200, dtype=np.uint8), volts)
        >>> check.found
        'packets of even and of odd number show different electrodes, as with a Daisy attached'
    """

    def __init__(self, used: Collection[int], *, step_uv: float) -> None:
        self._least_uv = _LEAST_STEPS * step_uv
        self._off = [k for k in range(8) if k + 1 not in used]
        self._counters: NDArray[np.uint8] = np.empty(0, np.uint8)
        self._volts: NDArray[np.float64] = np.empty((0, 8))
        self._n_alternate = self._n_moving = 0
        self.found, self.is_decided = "", False

    def take(self, counters: NDArray[np.uint8], microvolts: NDArray[np.float64]) -> None:
        """Compare the next packets: numbers (n,), and all channels (n, 8), also those switched off."""
        self._counters = np.concatenate([self._counters, counters])
        self._volts = np.concatenate([self._volts, microvolts])
        while len(self._counters) >= _WINDOW:
            self._compare(self._counters[:_WINDOW] % 2 == 0, self._volts[:_WINDOW])
            self._counters, self._volts = self._counters[_WINDOW:], self._volts[_WINDOW:]

    def _compare(self, is_even: NDArray[np.bool_], volts: NDArray[np.float64]) -> None:
        differ = _differ(volts[is_even], volts[~is_even], self._least_uv)
        self._n_alternate = self._n_alternate + 1 if differ else 0
        self._n_moving = self._n_moving + 1 if self._off_channels_move(volts) else 0
        self.is_decided = self.is_decided or max(self._n_alternate, self._n_moving) != 1
        if self._n_alternate >= _AGREE:
            self.found = (
                "packets of even and of odd number show different electrodes, as with a Daisy attached"
            )
        elif self._n_moving >= _AGREE:
            self.found = "channels that are switched off move: the bytes are shifted, or a Daisy is attached"

    def _off_channels_move(self, volts: NDArray[np.float64]) -> bool:
        moves = np.abs(np.diff(volts[:, self._off], axis=0)).max(axis=1, initial=0.0)
        return bool((moves > _OFF_UV).mean() > 0.25)


def _differ(even: NDArray[np.float64], odd: NDArray[np.float64], least_uv: float) -> bool:
    """Return whether any channel has another middle or another spread in one half than in the other."""
    least = min(len(even), len(odd))
    if least < _WINDOW // 4:
        return False
    middles = [np.median(half, axis=0) for half in (even, odd)]
    spreads = [
        _SD_OF_MAD * np.median(np.abs(half - middle), axis=0)
        for half, middle in zip((even, odd), middles, strict=True)
    ]
    error = np.sqrt((spreads[0] ** 2 + spreads[1] ** 2) / least)
    apart = np.abs(middles[0] - middles[1]) > _ERRORS * error + least_uv
    wide, narrow = np.maximum(*spreads), np.minimum(*spreads)
    return bool((apart | (wide > _RATIO * narrow + least_uv)).any())
