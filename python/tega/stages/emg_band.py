"""Filter raw EMG to the band of surface electrodes before anything is made of it (reading A39)."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

import numpy as np

from tega.errors import InvalidValueError
from tega.runtime.lifecycle import require

if TYPE_CHECKING:
    from numpy.typing import NDArray


_LOW_HZ: Final = 20.0
_HIGH_HZ: Final = 450.0
_HIGHEST_SHARE: Final = 0.45
_ORDER: Final = 4
_MAINS_HZ: Final = (50.0, 60.0)
_NOTCH_Q: Final = 30.0


class EmgBand:
    """Band-pass of order 4 from 20 to 450 Hz and a notch at 50 and at 60 Hz, sample by sample.

    The band is LibEMG's for surface EMG. Filtering in chunks gives the same result as filtering the whole signal.

    Raises:
        InvalidValueError: The rate is too low for the band.
        MissingExtraError: SciPy is not installed.
    """

    def __init__(self, rate_hz: float, n_channels: int) -> None:
        signal = require("scipy.signal", driver="rules", extra="learn")
        high_hz = min(_HIGH_HZ, _HIGHEST_SHARE * rate_hz)
        if high_hz <= 2 * max(_MAINS_HZ):
            raise InvalidValueError(
                f'before = "band" needs more than {2 * max(_MAINS_HZ) / _HIGHEST_SHARE:.0f} samples a second, '
                f"the source has {rate_hz:g}",
                'leave before = "nothing"',
            )
        parts = [signal.butter(_ORDER, (_LOW_HZ, high_hz), "bandpass", fs=rate_hz, output="sos")]
        parts += [signal.tf2sos(*signal.iirnotch(hz, _NOTCH_Q, fs=rate_hz)) for hz in _MAINS_HZ]
        self._sections: NDArray[np.float64] = np.concatenate(parts)
        self._filter = signal.sosfilt
        self._state = np.zeros((len(self._sections), 2, n_channels))
        self._last = np.zeros(n_channels)

    def take(self, samples: NDArray[np.float64]) -> NDArray[np.float64]:
        """Filter the next samples, float64 (n, channels).

        A sample that is no number is passed on as it is; the filter is given the one before.
        """
        held = np.vstack([self._last, samples])
        known = np.isfinite(held)
        rows = np.maximum.accumulate(np.where(known, np.arange(len(held))[:, None], 0), axis=0)
        held = np.take_along_axis(held, rows, axis=0)
        self._last = held[-1]
        filtered, self._state = self._filter(self._sections, held[1:], axis=0, zi=self._state)
        return np.where(known[1:], filtered, samples)
