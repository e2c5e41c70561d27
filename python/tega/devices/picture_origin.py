"""Tell whether a picture is the sensor's own: several sensors on one hub were seen to swap lines, or whole pictures."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Final, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray


# Reports speak of a tenth of a picture: bands of a twenty-fourth, so that one lies wholly within.
_N_BANDS: Final = 24
_ROWS_A_BAND: Final = 2
_N_COLUMNS: Final = 40
# Levels of 255, medians over a band. Two sensors' untouched pictures differ by 17 to 42 in every band, one sensor's by
# 4 to 8 where nothing touches it, and a press changes up to 27 (recordings of three sensors).
_FAR: Final = 12.0
_NEAR: Final = 8.0
_NEARER: Final = 0.4
_ALL_SHARE: Final = 0.9


class Origin(NamedTuple):
    """Verdict on whose a picture is.

    Attributes:
        other: The sensor that some of its bands look like; ``""`` if none do.
        share: Share of its bands that do.
        unlike: Whether nearly all of its bands are far from the own baseline and near to nobody's.
    """

    other: str
    share: float
    unlike: bool


class PictureOrigin:
    """Compares pictures with the sensor's own baseline and with those of the others, band by band.

    A band is another's if it is far from the own baseline, close to the other's, and much closer to it: what
    presses a gel changes a band, but into nobody else's light. Sensors whose baselines are alike cannot be told
    apart.

    Args:
        own: Baseline of the sensor, uint8 (H, W, 3), lines as the sensor sends them.
        others: Baselines of the others by name, likewise; those of another size are left out.
    """

    def __init__(self, own: NDArray[np.uint8], others: Mapping[str, NDArray[np.uint8]]) -> None:
        height, width = own.shape[:2]
        n_rows = _N_BANDS * _ROWS_A_BAND
        self._shape = own.shape
        self._rows = ((np.arange(n_rows) + 0.5) * height / n_rows).astype(np.intp)
        self._columns = ((np.arange(_N_COLUMNS) + 0.5) * width / _N_COLUMNS).astype(np.intp)
        self._own = self._bands(own)
        self._others = {name: self._bands(b) for name, b in others.items() if b.shape == own.shape}

    def judge(self, image: NDArray[np.uint8]) -> Origin:
        """Tell where a picture comes from.

        Args:
            image: uint8 (H, W, 3), lines as the sensor sends them.
        """
        if image.shape != self._shape:
            return Origin("", 0.0, unlike=False)
        bands = self._bands(image)
        # A median above a limit has at least half of the numbers above it: nearly every picture is through with this.
        apart = np.abs(bands - self._own).max(axis=2) > _FAR
        if 2 * np.count_nonzero(apart, axis=1).max() < apart.shape[1]:
            return Origin("", 0.0, unlike=False)
        own = _distance(bands, self._own)
        far = np.flatnonzero(own > _FAR)
        best, share = "", 0.0
        for name, other in self._others.items() if len(far) else ():
            theirs = _distance(bands[far], other[far])
            n = int(((theirs < _NEAR) & (theirs < _NEARER * own[far])).sum())
            if n / _N_BANDS > share:
                best, share = name, n / _N_BANDS
        return Origin(best, share, unlike=not best and len(far) >= _ALL_SHARE * _N_BANDS)

    def _bands(self, image: NDArray[np.uint8]) -> NDArray[np.int16]:
        """Take a few pixels of each band: int16 (bands, pixels, 3)."""
        picked = image[np.ix_(self._rows, self._columns)].astype(np.int16)
        return picked.reshape(_N_BANDS, _ROWS_A_BAND * _N_COLUMNS, 3)


def _distance(one: NDArray[np.int16], other: NDArray[np.int16]) -> NDArray[np.float64]:
    """Return the median over each band's pixels of the largest difference of a colour, levels."""
    distance: NDArray[np.float64] = np.median(np.abs(one - other).max(axis=2), axis=1)
    return distance
