"""Decide which frames of a fingertip camera are usable: new, complete, lit, and the sensor's own.

Sensors on one hub were seen to swap lines or frames.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Final, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from tega._native import band_distances, picture_bands
from tega.runtime.device_items import CameraCounts

# Mean below which a picture is black although the lights are on.
_BLACK = 5.0
# A sensor's noise makes two pictures, or two rows, never equal; so many equal ones are a stalled source.
_STUCK = 3
_TAIL_SHARE = 16
# How light a picture is, is asked of every so many-th pixel of every so many-th row.
_SAMPLE = 16

Verdict = Literal["good", "odd_size", "duplicate", "black", "torn", "foreign"]

WORDS: Final[Mapping[Verdict, str]] = MappingProxyType(
    {
        "odd_size": "of another size",
        "duplicate": "the same again and again",
        "black": "black",
        "torn": "torn",
        "foreign": "another sensor's",
    }
)
"""Descriptions of unusable frames."""


class JudgedPicture(NamedTuple):
    """Whether a picture can be used, or why not, and its sensor: ``None`` where that was not compared."""

    verdict: Verdict
    origin: Origin | None = None


def judge_picture(
    image: NDArray[np.uint8], last: NDArray[np.uint8] | None, baselines: SensorBands | None = None
) -> JudgedPicture:
    """Judge whether a picture can be used.

    Pictures are uint8 (H, W, 3), rows in the order the sensor sends them. ``last`` is the previous frame,
    ``None`` for the first. ``baselines`` serve to find another sensor's lines; ``None`` for no such check.
    """
    if last is not None and image.shape != last.shape:
        return JudgedPicture("odd_size")
    if last is not None and _equal(image, last):
        return JudgedPicture("duplicate")
    sample = image[::_SAMPLE, ::_SAMPLE]
    if np.add.reduce(sample, axis=None) < _BLACK * sample.size:
        return JudgedPicture("black")
    n_rows = max(2, len(image) // _TAIL_SHARE)
    tail = image[-n_rows:]
    if _of_one_colour(tail) or (last is not None and _equal(tail, last[-n_rows:])):
        return JudgedPicture("torn")
    origin = None if baselines is None else picture_origin(image, baselines)
    return JudgedPicture("foreign" if origin is not None and origin.other else "good", origin)


class PictureTally:
    """Counts judged pictures; ``foreign_shares`` is the largest share of a frame from each other sensor."""

    def __init__(self, counts: CameraCounts) -> None:
        self._counts = counts
        self._n_equal = 0
        self.foreign_shares: dict[str, float] = {}
        self.newest: Verdict = "good"

    def count(self, judged: JudgedPicture) -> bool:
        """Count a picture; return whether it can be used."""
        counts, verdict, origin = self._counts, judged.verdict, judged.origin
        self.newest = verdict
        counts.received += 1
        name = "used" if verdict == "good" else verdict
        setattr(counts, name, getattr(counts, name) + 1)
        if verdict != "odd_size":
            self._n_equal = self._n_equal + 1 if verdict == "duplicate" else 0
            counts.stuck += verdict == "duplicate" and self._n_equal == _STUCK - 1
        if origin is not None and origin.other:
            self.foreign_shares[origin.other] = max(origin.share, self.foreign_shares.get(origin.other, 0.0))
        elif origin is not None:
            counts.unlike += origin.unlike
        return verdict == "good"


def _equal(one: NDArray[np.uint8], other: NDArray[np.uint8]) -> bool:
    """Whether all pixels are equal; noise in the last row answers for nearly every picture."""
    return one[-1].tobytes() == other[-1].tobytes() and one.tobytes() == other.tobytes()


def _of_one_colour(rows: NDArray[np.uint8]) -> bool:
    """Whether all pixels are the last one; likewise."""
    colour = rows[-1, -1].tobytes()
    return all(lines.tobytes() == colour * (lines.size // len(colour)) for lines in (rows[-1], rows))


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
