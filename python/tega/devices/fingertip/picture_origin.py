"""Check whether a frame is the sensor's own: sensors on one hub were seen to swap lines or frames."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega._native import band_distances, picture_bands

# Levels of 255, medians over a band. Two sensors' untouched pictures differ by 17 to 42 in every band, one sensor's by
# 4 to 8 where nothing touches it, and a press changes up to 27 (recordings of three sensors).
_FAR: Final = 12.0
_NEAR: Final = 8.0
_NEARER: Final = 0.4
_ALL_SHARE: Final = 0.9


class Origin(NamedTuple):
    """Verdict on the sensor that a frame comes from.

    ``other`` is the sensor that some of its bands look like, ``""`` if none. ``unlike``: nearly all of its
    bands are far from its own baseline and near to no other.
    """

    other: str
    share: float
    unlike: bool


class SensorBands(NamedTuple):
    """Bands of the sensor's own baseline, of that shape, and of those of other sensors by name."""

    shape: tuple[int, ...]
    own: bytes
    others: Mapping[str, bytes]


def sensor_bands(own: NDArray[np.uint8], others: Mapping[str, NDArray[np.uint8]]) -> SensorBands:
    """Return the bands with which pictures are compared, from baselines by sensor.

    Baselines are uint8 (H, W, 3), lines as the sensor sends them; others of another size are left out.
    """
    alike = {name: picture_bands(b) for name, b in others.items() if b.shape == own.shape}
    return SensorBands(own.shape, picture_bands(own), alike)


def picture_origin(image: NDArray[np.uint8], baselines: SensorBands) -> Origin:
    """Return which sensor a picture comes from, compared band by band.

    A band belongs to another sensor if it is far from its own baseline, close to the other's, and much closer
    to the latter. A press changes a band, but never into another sensor's light. Sensors with similar
    baselines cannot be distinguished. ``image`` is uint8 (H, W, 3), lines as the sensor sends them.
    """
    if image.shape != baselines.shape:
        return Origin("", 0.0, unlike=False)
    bands = picture_bands(image)
    own = band_distances(bands, baselines.own)
    far = [k for k, distance in enumerate(own) if distance > _FAR]
    best, share = "", 0.0
    for name, other in baselines.others.items() if far else ():
        theirs = band_distances(bands, other)
        n = sum(theirs[k] < _NEAR and theirs[k] < _NEARER * own[k] for k in far)
        if n / len(own) > share:
            best, share = name, n / len(own)
    return Origin(best, share, unlike=not best and len(far) >= _ALL_SHARE * len(own))
